"""References that leave little vibration: impulses of a shaper, and the residual over the error of the frequency.

shaped  the record of `tfarm reference`
"""

from tfarm.references.shaped import ShapedReference, reference

__all__ = ["ShapedReference", "reference"]
