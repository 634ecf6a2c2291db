"""What the displacement says: residuals, strain, validity, errors against a truth, the summary.

May import `images`, `fem`, `geometry`, `correlation` and `errors`. Only `truth` reads a truth.
"""
