"""The measurement: grey-level functional, regularisation, Gauss-Newton, initialisation, transfer.

May import `images`, `fem`, `geometry` and `errors`. No step reads a truth.
Eq. 2, 3, 5: metric, gauss_newton. Eq. 6, 7: reduced_basis. Eq. 9 to 11: regularisation.
Eq. 10 and the default method: micro, corotational (with doubt), on register. Table 2: ultimate,
uncertainty. Appendix A: transfer. Starts beyond the paper: freeform, on spline_grid, spline_stencil and
spline_metric; micro_start.
"""
