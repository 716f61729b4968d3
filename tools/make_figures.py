"""Make the documentation's pictures: `python tools/make_figures.py ASSETS` (extra `people`).

`docs/demo.webp`: what `mt demo --compare` makes, moving.
`docs/how_it_works.png`: what each step of the method hands to the next.
`docs/people.jpg`: synthetic people with their IUV, half of them in MakeHuman's assets, whose folder
is named.
`docs/astronaut.jpg`: a photo alone, its estimated IUV and texture, and frames (needs the models).
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from threading import Event

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from motion_transfer.drawing.canvas import colour_iuv, paste
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.window import Window
from motion_transfer.events import ignore
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.people import PeopleStream
from motion_transfer.preview.driver import PreviewedDriver, plan_frames
from motion_transfer.preview.views import Views
from motion_transfer.render.composition import open_recipe
from motion_transfer.render.driver import open_driver
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.source import read_source

ROOT = Path(__file__).parents[1]
DEMO = ROOT / "motion_transfer" / "demo"
MOMENT = 24
WAVING = (0, 10, 20)
PEOPLE_SEED, PEOPLE_ROWS, PEOPLE_COLUMNS = 3, 6, 4
PANEL_PX = 240
LABEL_PX = 44


def main(assets: Path) -> None:
    options = RenderOptions(
        source=(DEMO / "source.png",), driver=DEMO / "driver.mkv", output=Path("unused.mp4")
    )
    recipe = open_recipe(options)
    source = read_source(options, recipe.texture_size)
    feature_map = recipe.appearance_of(source)
    assert isinstance(feature_map, FeatureMap)
    reader = open_reader(open_stream(options.driver))
    renderer = recipe.renderer(feature_map)
    target = next(iter(reader.read(MOMENT, MOMENT + 1)))
    result = np.full_like(target, 255)
    window = Window(0, 0, target.shape[0])
    crop = window.cut(target, renderer.working_size(window.side))
    paste(result, renderer.render(crop[None])[0], window)

    demo = [sys.executable, "-m", "motion_transfer", "demo", "--compare", "--force", "--output"]
    subprocess.run([*demo, str(ROOT / "docs" / "demo.webp")], check=True)
    save(ROOT / "docs" / "people.jpg", people_sheet(assets))
    save(ROOT / "docs" / "astronaut.jpg", photo_alone())

    partial = np.where(source.visibility[0, ..., None] > 0, picture(source.texture), 255)
    save(
        ROOT / "docs" / "how_it_works.png",
        np.hstack(
            [
                panel(source.photo.rgb, "source photo"),
                panel(colour_iuv(source.iuv), "its IUV"),
                panel(partial.astype(np.uint8), "partial texture: what is seen"),
                panel(picture(feature_map.features[0, :3]), "feature map (3 of 16), once"),
                panel(colour_iuv(target), "target IUV, per frame"),
                panel(result, "frame"),
            ]
        ),
    )


def photo_alone() -> np.ndarray:
    """What `mt demo --photo-alone` goes through."""
    options = RenderOptions(
        source=(DEMO / "astronaut.jpg",), driver=DEMO / "wave.mkv", output=Path("unused.mp4")
    )
    driver = PreviewedDriver(open_driver(options, ROOT, ignore))
    driver.see_all(Event(), lambda _count: None)
    plans, views = plan_frames(driver, options), Views()
    source = views.source(options)
    panels = [source.photo.rgb, colour_iuv(source.iuv), views.texture(options)]
    panels += [views.result(options, driver, plans, moment) for moment in WAVING]
    return np.hstack(
        [cv2.resize(each, (PANEL_PX,) * 2, interpolation=cv2.INTER_AREA) for each in panels]
    )


def people_sheet(assets: Path) -> np.ndarray:
    """Rows of photos, each with its IUV to the right."""
    stream = PeopleStream(seed=PEOPLE_SEED, size=(160, 160), assets=assets)
    cells = []
    for number in range(PEOPLE_ROWS * PEOPLE_COLUMNS):
        photo = stream.take(stream.dress(number), stream.shot(number, 0))
        cells.append(np.hstack([photo.rgb, colour_iuv(photo.iuv)]))
    rows = [cells[i : i + PEOPLE_COLUMNS] for i in range(0, len(cells), PEOPLE_COLUMNS)]
    return np.vstack([np.hstack(row) for row in rows])


def picture(texture) -> np.ndarray:
    """A texture in [-1, 1] as an RGB picture."""
    colours = np.moveaxis(texture, 0, -1)
    return ((colours + 1) * 127.5).round().clip(0, 255).astype(np.uint8)


def panel(image: np.ndarray, label: str) -> np.ndarray:
    """An image fitted into a white square, with a line of text below."""
    scale = min(PANEL_PX / image.shape[0], PANEL_PX / image.shape[1])
    size = round(image.shape[1] * scale), round(image.shape[0] * scale)
    fitted = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    square = np.full((PANEL_PX + LABEL_PX, PANEL_PX + 16, 3), 255, np.uint8)
    top, left = (PANEL_PX - size[1]) // 2, (PANEL_PX + 16 - size[0]) // 2
    square[top : top + size[1], left : left + size[0]] = fitted
    canvas = Image.fromarray(square)
    ImageDraw.Draw(canvas).text(
        ((PANEL_PX + 16) / 2, PANEL_PX + 20),
        label,
        fill=(60, 60, 60),
        anchor="mm",
        font=ImageFont.load_default(15),
    )
    return np.array(canvas)


def save(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    picture = Image.fromarray(image)
    if path.suffix == ".jpg":
        picture.save(path, quality=88)
    else:
        picture.quantize(192, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path}: {image.shape[1]} x {image.shape[0]}, {path.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
