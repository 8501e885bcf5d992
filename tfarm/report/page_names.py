"""The pages that may be asked for alone, by the name of `--only`."""

QUESTIONS = {
    "bode": "Bode plots",
    "modes": "Modes",
    "margins": "Gains and margins",
    "locus": "Root loci",
    "sampled": "The sampled loop",
    "tune": "The gain tuner",
    "assumptions": "What the assumptions do",
}
