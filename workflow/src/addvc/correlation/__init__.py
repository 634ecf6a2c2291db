"""The measurement: grey-level functional, regularisation, Gauss-Newton, initialisation, transfer.

May import `images`, `fem`, `geometry`, `config` and `errors` only. No step reads a truth.
Eq. 2, 3, 5: metric, gauss_newton. Eq. 6, 7: reduced_basis, meso_start. Eq. 9 to 11: regularisation.
Section 3.2: meso (on clear voxels). Eq. 10 and the default method: micro, corotational (with doubt),
on register. Cut-off lengths from the images: cutoff. Table 2: ultimate, uncertainty. Appendix A:
transfer. Meso DVC near equilibrium of a frame of struts: network (judged by network_risk), on frame_fit.
Starts beyond the paper: candidates, micro_start; freeform, on spline_grid, spline_stencil and
spline_metric.
"""
