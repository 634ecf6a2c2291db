"""The known field of a virtual test."""

from addvc.runtime import job
from addvc.twin.virtual import VirtualField

with job(snakemake):
    virtual = snakemake.params.virtual
    VirtualField(
        strains=tuple(virtual["strains"]),
        axis=snakemake.params.axis,
        amplitude=virtual["amplitude"],
        wavelength=virtual["wavelength"],
    ).save(snakemake.output[0])
