"""Reports: pages of pictures and tables that open from disk.

- `writing`: from records to a folder of pages, the index, and the page of a comparison
- `sections`: the sections of an arm's pages in their order, and the page that has each
- `page`: the records that a page asks for
- `arm_file`: the file of a page's arm, and the command that writes the page again
- `blocks`: texts, pictures and tables as a page has them
- `overview`: the first page of an arm, and its row in the index
- `response_sections`: the arm, its modes, responses and fits
- `loop_section`: margins, stability region, Nyquist plots, root loci
- `sampled_section`: the sampled loop, motion in time, the gain tuner
- `study_page`: the page of a study
- `trust`: method, proofs and published numbers
- `live`: the live page of a loop
"""

from tfarm.report.writing import write

__all__ = ["write"]
