"""Tables rendered: `terminal` for a person in a shell, `html` for a page, `files` for CSV and JSON.

The contents of a table are declared with the records; here nothing is known of any of them.
"""
