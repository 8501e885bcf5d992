"""Linear control loops of the exact arm, continuous-time and sampled: verdicts, margins, intervals, maps and loci.

Import from its modules: `from tfarm.loop.margins import margins`.  Of both loops:

* `loop`: a rig under a linear law
* `curve`: the verdict, and the loop function as a curve with margins
* `loop_margins`: margins of a loop function from its values

Of the continuous-time loop:

* `continuous`: the loop function, and the analytic function whose zeros are the poles
* `theorem`: the sign of a law, which decides every mode
* `poles`: closed-loop poles, complete in a box
* `stability`: the verdict, and the frequency range in which poles are counted
* `spillover`: the verdict, compared with those of design models
* `lines`: crossings of the imaginary axis along numbers of a law
* `windows`: stability intervals of each number
* `margins`: verdict, margins and stability intervals
* `nyquist`: Nyquist's criterion, compared with the poles
* `plane`: counts of unstable poles over two numbers, and the stability boundary
* `plane_axes`: ranges and scales of maps of the gains
* `varied`: the family of loops along one number
* `locus`: root loci along one number
* `loci`: loci of reduced models, and the gain that damps the first mode most
* `panels`: the loop function as polynomials, and sensor positions
* `inversion`: inversion of a Laplace transform near t = 0
* `time_response`: responses to steps and pulses from the poles

Of the sampled loop:

* `sampled_rig`: the rig and the law in z
* `sampled`: the loop, its matrix and its characteristic function
* `sampled_poles`: closed-loop poles with all digits
* `sampled_modes`: effect on each mode, and loci
* `left_poles`: poles that decay within a sample, their bound and response
* `circle`: certified count of poles outside the unit circle
* `circle_crossings`: crossings of the unit circle, stability intervals and maps
* `edges`: limits of stability with certified digits
* `sampled_verdict`: the verdict, certified or converged
* `sampled_analysis`: verdict, stability intervals, delay margin, modes and minimum damping
* `norms`: H-infinity norms of weighted functions, with certified bounds
* `sampled_brief`: the verdict in short
"""
