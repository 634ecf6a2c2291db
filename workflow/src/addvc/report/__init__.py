"""Figures and tables of a case from its results on disk, by matplotlib and off-screen VTK.

May import `images`, `fem`, `geometry`, `correlation`, `analysis`, `config` and `errors` only.
`case` reads results, `style` says how figures look, `scene` renders in parallel projection,
`surfaces` cuts out what is rendered; each other module makes the figures of one subject, named as in
the paper.
"""
