"""A run as an animated file: WebP, GIF or MP4."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from esail_jax.files.opening import ArgumentError
from esail_jax.viewing.drawing import Drawing, Style
from esail_jax.viewing.motion import Motion

QUALITY = 70
"""Quality of WebP, 0 to 100: lines and letters are still sharp."""

PALETTE = 64
"""Number of colours of a GIF."""

UNITS = {".webp": 1, ".gif": 10}
"""Units of the durations of pictures [ms]."""


def write_animation(motion: Motion, style: Style, path: Path, fps: float, suffix: str) -> None:
    """Writes all instants of a run as an animation that repeats for ever (an MP4 plays once).

    fps: frames per second; suffix: ".webp", ".gif" or ".mp4", the kind of file. Raises ArgumentError for an
    MP4 without the library imageio-ffmpeg."""
    if suffix == ".mp4":
        check_movie()
    drawing = Drawing(motion, style)
    images = (drawing.image(frame) for frame in range(len(motion.time)))
    if suffix == ".mp4":
        write_mp4(images, path, fps, (style.width, style.height))
        return
    frames = [Image.fromarray(image) for image in images]
    ends = np.round(np.arange(len(frames) + 1) * 1000.0 / (fps * UNITS[suffix])) * UNITS[suffix]
    # One duration each: rounded alike, 15 a second in a GIF would last 60 ms, and the whole a tenth less.
    how = {"duration": np.diff(ends).astype(int).tolist(), "loop": 0, "save_all": True}
    if suffix == ".gif":
        first = frames[0].quantize(PALETTE, dither=Image.Dither.NONE)
        frames = [frame.quantize(palette=first, dither=Image.Dither.NONE) for frame in frames]
        frames[0].save(path, "GIF", append_images=frames[1:], optimize=False, **how)
    else:
        frames[0].save(path, "WEBP", append_images=frames[1:], quality=QUALITY, method=4, **how)


def check_movie() -> None:
    """Raises ArgumentError if the library that writes MP4 files is not installed."""
    try:
        import imageio_ffmpeg  # noqa: F401
    except ImportError:
        install = 'imageio-ffmpeg be installed (pip install "esail_jax[movie]")'
        must, got = f"be a .webp or .gif file, or {install}", "it is a .mp4 file"
        raise ArgumentError("path", must, got) from None


def write_mp4(images: Iterator[np.ndarray], path: Path, fps: float, size: tuple[int, int]) -> None:
    """Writes images (height, width, 3) as an MP4 file."""
    import imageio_ffmpeg

    writer = imageio_ffmpeg.write_frames(
        str(path), size, fps=fps, macro_block_size=2, quality=7, output_params=["-f", "mp4"]
    )
    writer.send(None)
    for image in images:
        writer.send(np.ascontiguousarray(image))
    writer.close()
