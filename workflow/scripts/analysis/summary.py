"""The numbers of the whole case, in one file."""

from addvc.analysis.summary import summarise, twin_checks
from addvc.images.files import write_json
from addvc.provenance import commit
from addvc.runtime import job

with job(snakemake):
    numbers = {key: value for key, value in snakemake.params.items() if key != "code"}
    summary = summarise(**numbers)
    summary["twin_checks"] = twin_checks(snakemake.input.get("twin_check"))
    summary["versions"]["commit"] = commit()
    write_json(snakemake.output[0], summary)
