"""Side by side with other tools and on harder images: what `benchmarks/Snakefile` runs.

`elastix` is the peer (its package comes from `requirements.txt`), `study` reads what the workflow
measured and at what cost, `tables` writes it down. Nothing here is imported by `addvc`.
"""
