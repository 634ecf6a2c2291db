"""References of the methods, numbered as they are cited."""

REFERENCES = {
    "addvc": "Rouwane A, Doumalin P, Bouclier R, Passieux JC, Périé JN. Architecture-driven digital "
    "volume correlation: application to the analysis of in-situ crushing of a polyurethane foam. "
    "Experimental Mechanics (2023). doi:10.1007/s11340-023-00957-8",
    "addict": "Rouwane A, Bouclier R, Passieux JC, Périé JN. Architecture-driven digital image "
    "correlation technique (ADDICT) for the measurement of sub-cellular kinematic fields in "
    "speckle-free cellular materials. International Journal of Solids and Structures 234-235, 111223 "
    "(2022)",
    "snakemake": "Mölder F et al. Sustainable data analysis with Snakemake. F1000Research 10, 33 (2021)",
    "dvc": "Roux S, Hild F, Viot P, Bernard D. Three-dimensional image correlation from X-ray computed "
    "tomography of solid foam. Composites Part A 39(8), 1253-1265 (2008)",
    "spline": "Unser M. Splines: a perfect fit for signal and image processing. IEEE Signal Processing "
    "Magazine 16(6), 22-38 (1999)",
    "freeform": "Rueckert D, Sonoda LI, Hayes C, Hill DLG, Leach MO, Hawkes DJ. Nonrigid registration "
    "using free-form deformations: application to breast MR images. IEEE Transactions on Medical "
    "Imaging 18(8), 712-721 (1999)",
    "stuffing": "Labelle F, Shewchuk JR. Isosurface stuffing: fast tetrahedral meshes with good "
    "dihedral angles. ACM Transactions on Graphics 26(3), 57 (2007)",
    "gap": "Claire D, Hild F, Roux S. A finite element formulation to identify damage fields: the "
    "equilibrium gap method. International Journal for Numerical Methods in Engineering 61(2), 189-208 "
    "(2004)",
    "robust": "Geman S, McClure DE. Bayesian image analysis: an application to single photon emission "
    "tomography. Proceedings of the Statistical Computing Section, American Statistical Association, "
    "12-18 (1985)",
    "stein": "Stein CM. Estimation of the mean of a multivariate normal distribution. The Annals of "
    "Statistics 9(6), 1135-1151 (1981)",
    "limits": "Leclerc H, Périé JN, Hild F, Roux S. Digital volume correlation: what are the limits to "
    "the spatial resolution? Mechanics & Industry 13(6), 361-371 (2012)",
    "validation": "Golub GH, Heath M, Wahba G. Generalized cross-validation as a method for choosing a "
    "good ridge parameter. Technometrics 21(2), 215-223 (1979)",
    "bending": "Deshpande VS, Ashby MF, Fleck NA. Foam topology: bending versus stretching dominated "
    "architectures. Acta Materialia 49(6), 1035-1040 (2001)",
    "gradient": "Zimmerman JA, Bammann DJ, Gao H. Deformation gradients for continuum mechanical "
    "analysis of atomistic simulations. International Journal of Solids and Structures 46(2), 238-253 "
    "(2009)",
}  # fmt: skip


class Citations(dict):
    """Gives each key its number, [1], [2], ..., in the order of first use, for `str.format_map`."""

    def __missing__(self, key: str) -> str:
        if key not in REFERENCES:
            raise KeyError(key)
        self[key] = f"[{len(self) + 1}]"
        return self[key]

    def listed(self) -> list[str]:
        """The references that were used, a line each."""
        return [f"{number} {REFERENCES[key]}." for key, number in self.items()]
