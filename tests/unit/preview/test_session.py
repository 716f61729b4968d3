"""A preview shows what the run will make, and stays whole whatever is asked of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from threading import Event

import numpy as np
import pytest
from PIL import Image
from studio import LEGS, UPPER

from motion_transfer.batch.expand import expand
from motion_transfer.batch.manifest import read_manifest
from motion_transfer.errors import InputError, OutputError
from motion_transfer.events import ignore
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.preview.driver import PreviewedDriver, plan_frames
from motion_transfer.preview.queue import StaleError
from motion_transfer.preview.renders import Render
from motion_transfer.preview.session import Session
from motion_transfer.preview.state import describe
from motion_transfer.preview.views import Views, project_features
from motion_transfer.render.driver import open_driver
from motion_transfer.render.options import Partner, RenderOptions
from motion_transfer.render.run import run

COUNT = 40


@pytest.fixture
def options(studio, tmp_path: Path) -> RenderOptions:
    return RenderOptions(
        source=(studio.source(),),
        driver=studio.driver(COUNT),
        output=tmp_path / "out",
        renderer="texture",
    )


@pytest.fixture
def open_session(tmp_path: Path) -> Iterator[Callable[[RenderOptions], Session]]:
    sessions = []

    def make(options: RenderOptions, **how: bool) -> Session:
        sessions.append(Session(options, tmp_path / "home", tmp_path / "job.yaml", **how))
        return sessions[-1]

    yield make
    for session in sessions:
        session.close()


def picture(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(data)).convert("RGB"))


def open_previewed(options: RenderOptions) -> PreviewedDriver:
    return PreviewedDriver(open_driver(options, options.output.parent, ignore))


def see_all(options: RenderOptions) -> PreviewedDriver:
    driver = open_previewed(options)
    driver.see_all(Event(), lambda _count: None)
    return driver


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"frames": (5, 20)},
        {"window": "-3,4,64"},
        {"background": "photo", "size": "crop"},
        {"compare": False, "size": "even", "missing": "hold"},
    ],
)
def test_a_frame_is_the_one_that_the_run_draws(options: RenderOptions, changes: dict) -> None:
    options = replace(options, **changes)
    run(options)
    driver, views = see_all(options), Views()
    plans = plan_frames(driver, options)
    assert plans.exact
    for index in (plans.chosen.start, 12, plans.chosen.stop - 1):
        drawn = read_photo(options.output / f"{index - plans.chosen.start:06d}.png").rgb
        assert np.array_equal(views.result(options, driver, plans, index), drawn)


@pytest.mark.parametrize(
    "changes",
    [
        {"background": "sea.mkv", "shadow": True, "place": "0.3,0.8,0.7"},
        {"background": "sea.mkv", "size": "background", "on_the_spot": True},
        {"background": "sea.mkv", "background_blur": 3.0, "match_colours": True},
        {"background": "transparent", "shadow": True, "size": "crop"},
        {"driver": "two.npy", "driver_person": "0", "partners": "1", "shadow": True},
    ],
)
def test_a_scene_is_the_one_that_the_run_draws(
    options: RenderOptions, studio, changes: dict
) -> None:
    sea = np.random.default_rng(0).integers(0, 255, (7, 80, 120, 3), np.uint8)
    studio.video(sea, name="sea.mkv")
    frames = [np.hstack([studio.iuv(i % 3), studio.iuv(-i % 4, 2)]) for i in range(20)]
    studio.array(np.stack(frames), name="two.npy")
    if changes.get("background") == "sea.mkv":
        changes = {**changes, "background": str(studio.folder / "sea.mkv")}
    if "partners" in changes:
        bob = Partner(photo=studio.source("bob"), person=changes["partners"])
        changes = {**changes, "driver": studio.folder / "two.npy", "partners": (bob,)}
    options = replace(options, **changes)
    run(options)
    driver, views = see_all(options), Views()
    plans = plan_frames(driver, options)
    for index in (0, 11, 19):
        drawn = read_photo(options.output / f"{index:06d}.png")
        shown = views.result(options, driver, plans, index)
        assert np.array_equal(shown[..., :3], drawn.rgb)
        if options.transparent:
            assert np.array_equal(shown[..., 3], drawn.alpha)


def test_a_frame_of_the_network_is_the_one_that_the_run_draws(
    options: RenderOptions, checkpoint: Path
) -> None:
    options = replace(options, renderer="nhrr", weights=checkpoint, frames=(0, 3))
    run(options)
    driver = see_all(options)
    shown = Views().result(options, driver, plan_frames(driver, options), 2)
    drawn = read_photo(options.output / "000002.png").rgb
    assert np.abs(shown.astype(int) - drawn).max() <= 1  # batches of one and of four may differ


def test_before_the_driver_is_looked_through_a_sample_decides(options: RenderOptions) -> None:
    driver = open_previewed(options)
    plans = plan_frames(driver, options)
    assert not plans.exact
    assert len(driver.seen) < COUNT
    driver.see_all(Event(), lambda _count: None)
    whole = plan_frames(driver, options).shots[0].window
    near = plans.shots[0].window
    assert abs(near.x - whole.x) <= 4
    assert abs(near.side - whole.side) <= 8
    assert Views().result(options, driver, plans, 1).shape == (96, 64, 3)


def test_frames_outside_the_chosen_ones_can_be_seen(options: RenderOptions) -> None:
    options = replace(options, frames=(10, 20))
    driver = see_all(options)
    plans = plan_frames(driver, options)
    for index in (0, 39):
        assert len(np.unique(Views().result(options, driver, plans, index))) > 5


def test_a_broken_frame_is_marked_and_the_others_are_shown(
    options: RenderOptions, open_session
) -> None:
    (options.driver / "frame_7_IUV.png").write_bytes(b"no picture")
    session = open_session(options)
    session.wait_for_plan()
    state = describe(session)
    assert list(state["broken"]) == [7]
    assert "frame_7_IUV.png" in state["broken"][7]
    with pytest.raises(InputError, match="frame_7_IUV"):
        session.ask_frame(7, "result", session.key).result()
    assert picture(session.ask_frame(8, "result", session.key).result()).shape == (96, 64, 3)


@pytest.mark.parametrize("name", ["frame_7_IUV.png", "person.png"])
def test_a_file_that_changes_is_named_on_the_page(
    studio, options: RenderOptions, open_session, name: str
) -> None:
    """Pictures of the old and of the new content side by side would be no preview."""
    session = open_session(options)
    session.wait_for_plan()
    session.ask_frame(8, "result", session.key).result()
    revision = describe(session)["revision"]
    folder = options.driver if name.startswith("frame") else options.source[0].parent
    (folder / name).write_bytes((options.driver / "frame_1_IUV.png").read_bytes())
    time.sleep(0.2)  # it looks again and again, but not all the time
    with pytest.raises(InputError, match=f"{name} has changed since"):
        session.ask_frame(9, "result", session.key)
    state = describe(session)
    assert f"{name} has changed since" in state["error"]
    assert state["revision"] > revision


def test_a_video_can_be_read_in_any_order(studio, options: RenderOptions, monkeypatch) -> None:
    walk = studio.walk(30)
    driver = open_previewed(replace(options, driver=studio.video(walk)))
    opened = []
    reader = driver.opened.reader
    read = reader.read
    monkeypatch.setattr(reader, "read", lambda *ends: opened.append(ends) or read(*ends))
    for index in (20, 3, 4, 5, 6, 20, 29, 0):
        assert np.array_equal(driver.read(index), walk[index])
    assert opened == [(20, 21), (3, 4), (4, 20), (29, 30), (0, 1)]


@pytest.mark.parametrize("view", ["result", "iuv"])
def test_views_of_a_frame(options: RenderOptions, open_session, view: str) -> None:
    session = open_session(options)
    session.wait_for_plan()
    shown = picture(session.ask_frame(3, view, session.key).result())
    assert shown.shape == (96, 64, 3)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 8


def test_views_of_the_source(options: RenderOptions, open_session, checkpoint: Path) -> None:
    session = open_session(replace(options, renderer="nhrr", weights=checkpoint))
    session.wait_for_plan()
    assert picture(session.ask_still("source").result()).shape == (192, 128, 3)
    assert picture(session.ask_still("texture").result()).shape == (64, 64, 3)
    assert picture(session.ask_still("map").result()).shape == (64, 64, 3)
    features = picture(session.ask_frame(3, "features", session.key).result())
    assert features.shape == (112, 112, 3), "the crop, as large as it is drawn"
    assert (features[0, 0] == 255).all()


def test_the_texture_renderer_has_no_feature_map(options: RenderOptions, open_session) -> None:
    session = open_session(options)
    session.wait_for_plan()
    for future in (session.ask_still("map"), session.ask_frame(0, "features", session.key)):
        with pytest.raises(InputError, match="the texture renderer has no feature map"):
            future.result()


def test_a_draft_is_drawn_without_the_network(
    options: RenderOptions, open_session, checkpoint: Path
) -> None:
    session = open_session(replace(options, renderer="nhrr", weights=checkpoint))
    session.wait_for_plan()
    draft = session.ask_frame(3, "result", session.key, draft=True).result()
    session.change({"renderer": "texture"})
    assert session.ask_frame(3, "result", session.key).result() == draft


def test_weights_come_back_with_the_network(
    options: RenderOptions, open_session, checkpoint: Path
) -> None:
    session = open_session(replace(options, renderer="nhrr", weights=checkpoint))
    session.change({"renderer": "texture"})
    assert session.options.weights is None
    session.change({"renderer": "nhrr"})
    assert session.options.weights == checkpoint


def test_an_option_changes_the_pictures_and_their_key(options: RenderOptions, open_session) -> None:
    session = open_session(options)
    session.wait_for_plan()
    before, revision = session.key, session.revision
    session.change({"background": "#102030"})
    assert session.revision > revision
    with pytest.raises(StaleError):
        session.ask_frame(0, "result", before)
    corner = picture(session.ask_frame(0, "result", session.key).result())[0, 0]
    assert np.abs(corner.astype(int) - (16, 32, 48)).max() <= 3
    session.change({"background": "white"})
    assert session.key == before


def test_legs_that_no_photo_shows_are_dressed_by_choice(
    studio, options: RenderOptions, open_session
) -> None:
    half = studio.source("half", parts=UPPER)
    session = open_session(replace(options, source=(half,)))
    session.wait_for_plan()
    wait_for(lambda: session.source is not None)
    assert "shows no legs" in "".join(session.source.notes)
    worn = picture(session.ask_frame(0, "result", session.key).result())
    session.change({"unseen_legs": "guess"})
    assert not session.source.notes
    guessed = picture(session.ask_frame(0, "result", session.key).result())
    away = np.abs(worn.astype(int) - guessed).max((1, 2)) > 30
    assert away.any()
    assert not away[: len(away) // 4].any()  # of head and chest nothing changes


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ({"background": "mauve"}, "background mauve does not exist"),
        ({"renderer": "gan"}, "renderer is 'gan'"),
        ({"person": "4"}, "person"),
        ({"driver_person": "4"}, "person"),
        ({"frames": "50:60"}, "has 40"),
        ({"window": "1,2"}, "write X,Y,SIDE"),
        ({"window": "1,2,3"}, "between 16 and"),
        ({"frame_rate": "0"}, "between 0 and 1000"),
        ({"output": "/etc/passwd"}, "option 'output'"),
        ({"source": "/etc/passwd"}, "option 'source'"),
        ({"background": "black", "frames": "9:3"}, "frames 9:3"),
        ({"person": "0", "frames": "50:60"}, "has 40"),
    ],
)
def test_what_cannot_be_changes_nothing(
    options: RenderOptions, open_session, words: dict, reason: str
) -> None:
    session = open_session(options)
    session.wait_for_plan()
    wait_for(lambda: session.source is not None)
    before = session.key, session.source
    with pytest.raises(InputError, match=reason):
        session.change(words)
    assert session.options == options
    assert session.key == before[0]
    assert session.source is before[1]


@pytest.mark.parametrize(
    ("index", "view", "reason"),
    [(COUNT, "result", "has 40"), (-1, "result", "has 40"), (0, "../secret", "view '../secret'")],
)
def test_there_are_only_so_many_pictures(
    options: RenderOptions, open_session, index: int, view: str, reason: str
) -> None:
    session = open_session(options)
    session.wait_for_plan()
    with pytest.raises(InputError, match=reason):
        session.ask_frame(index, view, session.key)
    with pytest.raises(InputError, match="view 'nothing'"):
        session.ask_still("nothing")


def rendered(session: Session, number: int) -> Render:
    """Wait for a run's end."""
    wait_for(lambda: session.renders.get(number).status not in ("waiting", "running"))
    return session.renders.get(number)


def test_rendering_makes_what_the_run_makes(options: RenderOptions, open_session) -> None:
    session = open_session(options)
    session.wait_for_plan()
    session.change({"background": "black", "frames": "3:9"})
    render = rendered(session, session.render(replace_output=False))
    assert render.progress is not None
    assert (render.status, render.progress.done, render.progress.total) == ("done", 6, 6)
    first = read_photo(options.output / "000000.png").rgb
    assert (first[0, 0] == 0).all()
    with pytest.raises(OutputError, match="exists already"):
        session.render(replace_output=False)
    assert rendered(session, session.render(replace_output=True)).status == "done"
    assert len(session.renders.all) == 1, "the one that it replaces is forgotten"


def test_a_render_can_report_while_the_state_is_described(options, open_session) -> None:
    """Who describes holds the session and asks the renders; they must not wait for the session."""
    session = open_session(options)
    session.wait_for_plan()
    with session.lock:
        number = session.renders.add(replace(session.options, frames=(0, 2))).number
        wait_for(lambda: session.renders.get(number).status == "done")
    assert describe(session)["renders"][0]["status"] == "done"


def test_nobody_is_drawn_until_somebody_is_chosen(options: RenderOptions, open_session) -> None:
    session = open_session(options, is_empty=True, names_output=False)
    session.wait_for_plan()
    state = describe(session)
    assert (state["sources"], state["command"], state["error"]) == ([], "", None)
    with pytest.raises(InputError, match="drop a photo"):
        session.ask_frame(3, "result", session.key)
    with pytest.raises(InputError, match="drop a photo"):
        session.render(replace_output=False)
    assert picture(session.ask_frame(3, "iuv", session.key).result()).shape == (96, 64, 3)
    session.choose_sources(
        drop(session, options.source[0], options.source[0].with_stem("person_IUV"))
    )
    assert picture(session.ask_frame(3, "result", session.key).result()).shape == (96, 64, 3)
    output = describe(session)["output"]
    assert (output["name"], output["folder"]) == ("person_driver", str(session.folder / "videos"))


def test_another_motion_takes_the_place_of_the_first(
    options: RenderOptions, open_session, studio
) -> None:
    session = open_session(options)
    session.wait_for_plan()
    session.change({"frames": "3:9", "window": "1,2,60"})
    key = session.key
    number = session.choices.know_motion(studio.video(9))
    session.choose_motion([number])
    session.wait_for_plan()
    state = describe(session)
    assert state["driver"]["frame_count"] == 9
    assert (state["options"]["frames"], state["options"]["window"]) == ([0, 9], None)
    assert session.key != key
    with pytest.raises(StaleError):
        session.ask_frame(0, "result", key)
    assert picture(session.ask_frame(8, "result", session.key).result()).ndim == 3
    session.cancel_motion()
    session.wait_for_plan()
    assert describe(session)["driver"]["frame_count"] == COUNT


def test_a_motion_is_seen_from_elsewhere(options, open_session, body_model) -> None:
    session = open_session(replace(options, renderer="texture"))
    session.wait_for_plan()
    assert describe(session)["can_turn"] is False  # IUV is what one camera saw
    walk = session.choices.know_motion(Path("people:walk"))
    for azimuth in (0.0, 90.0):
        session.choose_motion([walk], azimuth)
        session.wait_for_plan()
    state = describe(session)
    assert (state["motion"], state["azimuth"], state["can_turn"]) == (walk, 90.0, True)
    assert session.options.driver == Path("people:walk,azimuth=90")
    iuv = picture(session.ask_frame(0, "iuv", session.key).result())
    session.cancel_motion()
    session.wait_for_plan()
    assert session.options.driver == Path("people:walk")
    assert (iuv != picture(session.ask_frame(0, "iuv", session.key).result())).any()


def test_a_clip_of_pictures_is_seen_by_a_body_that_is_fitted_to_it(
    options, open_session, studio, tmp_path: Path
) -> None:
    session = open_session(options)
    session.wait_for_plan()
    iuv = session.motion
    session.choose_motion([iuv], 45.0)
    with pytest.raises(InputError, match="--azimuth fits a body to pictures"):
        session.wait_for_plan()
    raw = studio.image("clip/0.png", np.full((40, 40, 3), 90, np.uint8))
    clip = session.choices.know_motion(raw)
    session.choose_motion([clip], 45.0)
    assert (session.options.azimuth, session.azimuth) == (45.0, 45.0)
    session.choose_motion([iuv])
    assert (session.options.azimuth, session.azimuth) == (None, 0.0)


def test_frames_that_are_sent_together_are_one_motion(options, open_session) -> None:
    session = open_session(options)
    numbers = []
    for frame in (options.driver / f"frame_{index}_IUV.png" for index in range(7)):
        with session.dropped.begin("drop", frame.name) as upload:
            upload.write(frame.read_bytes())
            numbers.append(session.choices.know_motion(upload.finish(motion=True)))
    session.choose_motion(numbers)
    session.wait_for_plan()
    assert describe(session)["driver"]["frame_count"] == 7


def test_a_motion_that_is_none_leaves_the_others_to_choose(options, open_session, studio) -> None:
    session = open_session(options)
    session.wait_for_plan()
    first = session.motion
    session.choose_motion([session.choices.know_motion(studio.folder / "gone.mkv")])
    with pytest.raises(InputError, match=r"gone\.mkv does not exist"):
        session.wait_for_plan()
    session.choose_motion([first])
    session.wait_for_plan()
    assert session.error is None
    with pytest.raises(InputError, match="there is no motion 99"):
        session.choose_motion([99])


def test_clothes_come_from_another_photo(options, open_session, studio) -> None:
    session = open_session(options)
    session.wait_for_plan()
    red = studio.source("red", colours={LEGS: (250, 0, 0)})
    before = session.ask_frame(3, "result", session.key).result()
    (number, _) = drop(session, red, studio.folder / "red_IUV.png")
    session.choose_garments([(number, "upper-legs,lower-legs")])
    worn = session.ask_frame(3, "result", session.key).result()
    assert worn != before
    assert describe(session)["garments"] == [
        {"number": number, "name": "red.png", "parts": ["upper-legs", "lower-legs"]}
    ]
    assert "--garment-parts" in describe(session)["command"]
    with pytest.raises(InputError, match="unknown part"):
        session.choose_garments([(number, "hat")])
    assert session.ask_frame(3, "result", session.key).result() == worn
    session.choose_garments([])
    assert session.ask_frame(3, "result", session.key).result() == before


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ({"format": ".exe"}, "format '.exe'"),
        ({"format": ""}, "format ''"),
        ({"crf": "99"}, "takes a crf"),
        ({"crf": "best"}, "whole number"),
        ({"audio": "/etc/passwd"}, "sound '/etc/passwd'"),
        ({"format": ".gif", "crf": "20"}, "crf"),
    ],
)
def test_outputs_that_cannot_be(options, open_session, words: dict, reason: str) -> None:
    session = open_session(replace(options, output=options.output.with_suffix(".mp4")))
    with pytest.raises(InputError, match=reason):
        session.change(words)


def test_an_output_gets_a_name_and_no_path(options, open_session) -> None:
    session = open_session(replace(options, output=options.output.with_suffix(".mp4")))
    session.change({"name": "../../etc/my dance", "crf": "30"})
    assert session.options.output == options.output.with_name("my_dance.mp4")
    session.change({"format": ".gif"})
    assert session.options.output.name == "my_dance.gif"
    assert session.options.crf is None, "which was the video's"


def test_names_that_nobody_gave_replace_nothing(options, open_session) -> None:
    session = open_session(options, names_output=False)
    session.wait_for_plan()
    session.change({"format": ".gif", "frames": "0:4"})
    numbers = [session.render(replace_output=False) for _ in range(2)]
    names = [rendered(session, number).options.output.name for number in numbers]
    assert names == ["person_driver.gif", "person_driver-2.gif"]
    assert all((session.folder / "videos" / name).is_file() for name in names)


def test_a_saved_job_is_the_run(options: RenderOptions, open_session, tmp_path: Path) -> None:
    session = open_session(options)
    session.wait_for_plan()
    session.change({"frames": "3:9", "window": "1,2,60", "frame_rate": "30000/1001"})
    session.save_job(replace_file=False)
    (job,) = expand(*read_manifest(tmp_path / "job.yaml"))
    assert job.options == session.options
    with pytest.raises(OutputError, match="exists already"):
        session.save_job(replace_file=False)
    session.save_job(replace_file=True)


def test_a_driver_that_is_none_is_said_in_words(options: RenderOptions, open_session) -> None:
    session = open_session(replace(options, driver=options.driver.with_name("gone")))
    with pytest.raises(InputError, match="gone does not exist"):
        session.wait_for_plan()
    state = describe(session)
    assert "does not exist" in state["error"]
    assert state["driver"] is None


def test_an_error_goes_when_its_cause_does(options: RenderOptions, open_session) -> None:
    session = open_session(replace(options, driver_person="5"))
    with pytest.raises(InputError, match="person 5"):
        session.wait_for_plan()
    session.change({"driver_person": "largest"})
    assert describe(session)["error"] is None
    assert picture(session.ask_frame(3, "result", session.key).result()).shape == (96, 64, 3)


def test_somebody_only_between_the_sampled_frames_is_found(studio, options, open_session) -> None:
    frames = np.zeros((200, 96, 64, 3), np.uint8)
    frames[3:8] = studio.iuv()
    session = open_session(replace(options, driver=studio.array(frames)))
    session.wait_for_plan()
    state = describe(session)
    assert state["error"] is None
    assert state["missing"] == ((0, 3), (8, 200))


def test_a_source_that_is_none_is_said_in_words(options: RenderOptions, open_session) -> None:
    session = open_session(replace(options, source=(options.source[0].with_name("gone.png"),)))
    wait_for(lambda: session.error is not None)
    assert "gone.png does not exist" in describe(session)["error"]


def drop(session: Session, *photos: Path) -> list[int]:
    """Send files as the page does, together; returns their numbers."""
    numbers = []
    for photo in photos:
        with session.dropped.begin("drop", photo.name) as upload:
            upload.write(photo.read_bytes())
            numbers.append(session.choices.know_photo(upload.finish()))
    return numbers


def test_dropped_photos_join_replace_and_lead(studio, options, open_session) -> None:
    session = open_session(options)
    session.wait_for_plan()
    legs = studio.source("legs", parts=LEGS, colours={LEGS: (250, 0, 250)})
    numbers = drop(session, legs, studio.folder / "legs_IUV.png")
    wait_for(lambda: session.source is not None)
    key, alone = session.key, session.ask_still("texture").result()
    session.choose_sources([0, *numbers])
    assert session.key != key
    assert session.ask_still("texture").result() != alone
    names = [source["name"] for source in describe(session)["sources"]]
    assert names == ["person.png", "legs.png"], "IUV is no source"
    session.choose_sources([numbers[0], 0])
    assert [path.name for path in session.options.source] == ["legs.png", "person.png"]
    assert picture(session.ask_source_picture(numbers[0]).result()).shape == (192, 128, 3)
    session.choose_sources([0])
    assert session.key == key


def test_a_photo_of_nobody_leaves_the_source_as_it_was(studio, options, open_session) -> None:
    session = open_session(options)
    session.wait_for_plan()
    photo = studio.image("empty.png", np.full((40, 40, 3), 90, np.uint8))
    iuv = studio.image("empty_IUV.png", np.zeros((40, 40, 3), np.uint8))
    key = session.key
    numbers = drop(session, photo, iuv)
    with pytest.raises(InputError, match="no person in it"):
        session.choose_sources([0, *numbers])
    for wrong in ([], [7], [-1]):
        with pytest.raises(InputError, match=r"no source.*; choose one of those"):
            session.choose_sources(wrong)
    assert (session.options, session.key, session.error) == (options, key, None)
    assert picture(session.ask_frame(3, "result", key).result()).shape == (96, 64, 3)


def test_what_was_sent_outlives_the_preview(studio, options, tmp_path) -> None:
    session = Session(options, tmp_path / "home", tmp_path / "job.yaml")
    session.wait_for_plan()
    numbers = drop(session, studio.source("named"), studio.folder / "named_IUV.png")
    session.choose_sources([0, *numbers])
    session.save_job(replace_file=False)
    session.close()
    (job,) = expand(*read_manifest(tmp_path / "job.yaml"))
    assert [path.name for path in job.options.source] == ["person.png", "named.png"]
    assert all(path.exists() for path in job.options.source)


def test_the_same_features_have_the_same_colours_in_map_and_image() -> None:
    features = np.random.default_rng(1).normal(size=(16, 8, 8)).astype(np.float32)
    mean, deviation = np.zeros(3), np.ones(3)
    whole = project_features(features, mean, deviation)
    assert np.array_equal(project_features(features[:, 2:4, 5:6], mean, deviation), whole[2:4, 5:6])
    assert whole.dtype == np.uint8
    assert len(np.unique(whole)) > 50


def wait_for(condition: Callable[[], bool]) -> None:
    for _ in range(600):
        if condition():
            return
        time.sleep(0.05)
    raise AssertionError("it did not happen within half a minute")


def test_a_background_that_changes_meanwhile_is_told(
    options: RenderOptions, studio, open_session
) -> None:
    behind = studio.image("wall.png", np.full((8, 8, 3), 90, np.uint8))
    session = open_session(options)
    session.wait_for_plan()
    session.change({"background": str(behind)})
    assert picture(session.ask_frame(0, "result", session.key).result())[0, 0, 0] == 90
    studio.image("wall.png", np.full((9, 9, 3), 10, np.uint8))
    with pytest.raises(InputError, match=r"wall\.png has changed"):
        session.ask_frame(1, "result", session.key)
    session.change({"background": str(behind)})
    assert session.error is None
