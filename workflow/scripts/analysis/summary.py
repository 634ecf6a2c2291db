"""The numbers of the whole case, in one file."""

from addvc.runtime import job
from addvc.analysis.summary import Scope, summarise, twin_checks
from addvc.images.files import write_json
from addvc.provenance import commit

with job(snakemake):
    params = snakemake.params
    summary = summarise(params.case, params.folder, params.states, Scope(**params.scope))
    summary["twin_checks"] = twin_checks(snakemake.input.get("twin_check"))
    summary["versions"]["commit"] = commit()
    write_json(snakemake.output[0], summary)
