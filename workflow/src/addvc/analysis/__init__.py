"""What the displacement says: residuals, strain, validity, errors against a truth, the summary.

May import `images`, `fem`, `geometry`, `correlation`, `config` and `errors` only. `truth`,
`mesh_truth`, `struts_truth`, `twin_check` and `difficulty` alone know of a truth; the first, third and
fourth import `twin` for it.
"""
