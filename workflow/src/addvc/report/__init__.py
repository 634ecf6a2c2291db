"""Figures and tables of a case from its results on disk, by matplotlib and off-screen VTK.

May import every other folder but `twin`. `case` reads results, `style` says how figures look,
`scene` renders in parallel projection, `surfaces` cuts out what is rendered; each other module
makes the figures of one subject, named as in the paper.
"""
