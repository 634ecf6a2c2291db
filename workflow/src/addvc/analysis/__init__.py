"""What the displacement says: residuals, strain, validity, errors against a truth, the summary.

May import `images`, `fem`, `geometry`, `correlation` and `errors`. Only `truth`,
`mesh_truth`, `struts_truth`, `twin_check` and `difficulty` know of a truth.
"""
