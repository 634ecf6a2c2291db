"""A figure made small enough for the first page of the report, which no file goes with."""

import base64
import io
from pathlib import Path

from matplotlib.image import imread, imsave
from skimage.transform import resize

WIDTH, QUALITY = 900, 75  # pixels, of JPEG


def thumbnail(path: str | Path) -> str:
    """A figure (PNG) as the address of an image (`data:`) that holds it."""
    image = imread(path)[..., :3]
    rows = round(image.shape[0] * WIDTH / image.shape[1])
    small = resize(image, (rows, WIDTH), anti_aliasing=True)
    stream = io.BytesIO()
    imsave(stream, small.clip(0, 1), format="jpg", pil_kwargs={"quality": QUALITY})
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode()
