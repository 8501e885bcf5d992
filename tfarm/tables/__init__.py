"""Tables rendered: `terminal` for a person in a shell, `html` for a page, `files` for CSV and JSON.

What a table holds is declared beside the records (`tfarm.columns`); here nothing is known of any of them.
"""
