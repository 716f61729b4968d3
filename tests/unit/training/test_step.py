"""One step: who learns what, in every variant, and that no loss is dropped in silence."""

from __future__ import annotations

from contextlib import nullcontext
from copy import deepcopy
from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.training.face_networks import DlibFace, dlib_identity
from motion_transfer.training.faces import FaceIdentity, SphereFace20, face_table
from motion_transfer.training.feature_networks import FeatureNetwork
from motion_transfer.training.settings import LossSettings
from motion_transfer.training.step import (
    Arithmetic,
    Average,
    Drawn,
    Generator,
    Judges,
    Players,
    load_judges,
    set_stage,
    shown_image,
    update,
)
from nhrr_core import VARIANTS, Discriminator, LossWeights, ModelConfig, NeuralReRenderer

PLAIN = Arithmetic(nullcontext, lambda loss: loss.backward(), lambda network: network)
JUDGED_BY_ALL = {"perceptual", "identity", "adversarial", "discriminator", "total"}


class Pixels(FeatureNetwork):
    """A judge that looks at the image itself."""

    layer_weights = (1.0,)

    def forward(self, image: Tensor) -> list[Tensor]:
        return [image]


class Game:
    """A model, its opponent and a batch, tiny."""

    def __init__(self, variant: str = "full", *, alpha: bool = False) -> None:
        torch.manual_seed(0)
        config = ModelConfig(
            variant=variant,  # pyright: ignore[reportArgumentType]
            feature_width=4,
            render_width=4,
            residual_blocks=1,
            image_size=32,
            texture_size=32,
            alpha=alpha,
        )
        self.model = NeuralReRenderer(config)
        self.discriminator = Discriminator(
            image_channels=config.render_outputs,
            condition_channels=config.render_inputs,
            width=4,
            scales=2,
        )
        self.players = Players(
            Generator(self.model),
            torch.optim.Adam(self.model.parameters(), lr=1e-2),
            self.discriminator,
            torch.optim.Adam(self.discriminator.parameters(), lr=1e-2),
        )
        iuv = torch.randint(1, 25, (2, 3, 32, 32)).to(torch.uint8)
        self.batch = {
            "source_texture": torch.rand(2, 3, 32, 32) * 2 - 1,
            "source_visibility": torch.ones(2, 1, 32, 32),
            "target_image": torch.rand(2, 3, 32, 32) * 2 - 1,
            "target_iuv": iuv,
        }
        if config.reads_photo:
            rgb, shown = torch.randint(256, (2, 3, 32, 32)), torch.randint(1, 25, (2, 3, 32, 32))
            self.batch["source_pictures"] = torch.cat([rgb, shown], 1)[:, None].to(torch.uint8)
        if config.supervises_texture:
            self.batch["target_texture"] = torch.rand(2, 3, 32, 32) * 2 - 1
            self.batch["target_visibility"] = torch.ones(2, 1, 32, 32)
        if alpha:
            self.batch["target_alpha"] = torch.rand(2, 1, 32, 32) * 2 - 1

    def update(
        self, judges: Judges | None = None, players: Players | None = None, **how
    ) -> dict[str, Tensor]:
        judges = Judges(Pixels()) if judges is None else judges
        how = {"adversarial": True, **how}
        return update(self.batch, players or self.players, judges, LossWeights(), PLAIN, **how)

    def changed(self, before: dict[str, Tensor], network: nn.Module) -> set[str]:
        """Top-level parts of a network whose tensors differ from before."""
        return {
            name.partition(".")[0]
            for name, tensor in network.state_dict().items()
            if not torch.equal(tensor, before[name])
        }


def copy(network: nn.Module) -> dict[str, Tensor]:
    return {name: tensor.clone() for name, tensor in network.state_dict().items()}


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_trains_all_of_it(variant: str) -> None:
    game = Game(variant)
    set_stage(game.model, inpainting=False)
    model, discriminator = copy(game.model), copy(game.discriminator)
    terms = game.update(Judges(Pixels(), FaceIdentity(SphereFace20())))
    supervised = ("full", "ip", "texture-features", "cbi", "dpt")
    wanted = JUDGED_BY_ALL | ({"texture"} if variant in supervised else set())
    assert set(terms) == wanted
    ends_to_end = ("full", "no-int", "texture-features")
    learned = {"render_net"} | ({"feature_net"} if variant in ends_to_end else set())
    learned |= {"photo_net"} if variant == "texture-features" else set()
    assert game.changed(model, game.model) == learned
    assert game.changed(discriminator, game.discriminator) == {"scales"}
    assert all(torch.isfinite(term) and not term.requires_grad for term in terms.values())


@pytest.mark.parametrize("variant", ["ip", "cbi", "dpt"])
def test_the_first_stage_trains_the_inpainting_alone(variant: str) -> None:
    game = Game(variant)
    set_stage(game.model, inpainting=True)
    model, discriminator = copy(game.model), copy(game.discriminator)
    terms = game.update(inpainting=True)
    assert set(terms) == {"texture", "total"}
    assert game.changed(model, game.model) == {"feature_net"}
    assert not game.changed(discriminator, game.discriminator)


def test_alpha_is_learned_and_judged() -> None:
    game = Game(alpha=True)
    terms = game.update()
    assert "alpha" in terms
    assert next(game.discriminator.parameters()).shape[1] == 4 + 16


def test_what_is_judged_lies_over_the_background() -> None:
    """Whoever is not there at all may be of any colour."""
    game = Game(alpha=True)
    background = torch.tensor([[1.0, 0.0, -1.0], [0.5, 0.5, 0.5]])
    image = torch.rand(2, 4, 8, 8) * 2 - 1
    image[:, 3, :, :2], image[:, 3, :, 2:4], image[:, 3, :, 4:] = -1, 1, 0
    drawn = Drawn(torch.empty(0), None, image)
    assert torch.equal(shown_image({}, drawn), image)
    shown = shown_image({"target_background": background}, drawn)
    behind = background[:, :, None, None].expand(-1, -1, 8, 8)
    assert torch.equal(shown[:, :3, :, :2], behind[..., :2])
    assert torch.allclose(shown[:, :3, :, 2:4], image[:, :3, :, 2:4])
    assert torch.allclose(shown[:, :3, :, 4:], (image[:, :3, :, 4:] + behind[..., 4:]) / 2)
    assert torch.equal(shown[:, 3], image[:, 3])
    plain = game.update()
    over = Game(alpha=True)
    over.batch["target_background"] = background
    terms = over.update()
    for name in ("perceptual", "adversarial"):
        assert terms[name] != plain[name], name
    assert terms["alpha"] == plain["alpha"]


def test_the_total_is_weighted() -> None:
    terms = Game().update()
    weighted = 10 * terms["perceptual"] + terms["adversarial"] + terms["texture"]
    assert terms["total"] == pytest.approx(float(weighted), rel=1e-5)


def test_feature_matching_pulls_the_generator_towards_what_is_real() -> None:
    game = Game(alpha=True)
    weights = LossWeights(adversarial=0.0, texture=0.0, alpha=0.0, matching=1.0)
    learner = game.players.generator_optimiser
    players = Players(game.players.generator, learner, game.discriminator, Still())
    found = [
        float(update(game.batch, players, Judges(), weights, PLAIN, adversarial=True)["matching"])
        for _ in range(30)
    ]
    assert found[-1] < 0.8 * found[0]
    assert "matching" not in game.update()


def test_the_r1_penalty_holds_the_discriminator_back() -> None:
    def train(r1_weight: float) -> tuple[float, dict[str, Tensor]]:
        game = Game()
        rest = Players(
            game.players.generator,
            Still(),
            game.discriminator,
            game.players.discriminator_optimiser,
        )
        for _ in range(20):
            game.model.zero_grad()
            terms = game.update(players=rest, r1_weight=r1_weight)
        terms = game.update(players=rest, r1_weight=1e-9)
        return float(terms["r1"]), copy(game.model)

    (free, model), (held, other) = train(0), train(10)
    assert held < 0.1 * free
    assert all(torch.equal(model[name], other[name]) for name in model), "the generator rests"
    assert "r1" not in Game().update()


def test_before_its_start_the_discriminator_rests() -> None:
    game = Game()
    before = copy(game.discriminator)
    assert set(game.update(adversarial=False)) == {"perceptual", "texture", "total"}
    assert not game.changed(before, game.discriminator)


def test_the_generator_leaves_no_gradient_in_the_discriminator() -> None:
    """Else the next step of the discriminator would hold what the generator wished for."""
    game = Game()
    left: list[Tensor | None] = []

    class Looking(Still):
        def step(self) -> None:
            left.extend(parameter.grad for parameter in game.discriminator.parameters())

    players = Players(game.players.generator, Looking(), game.discriminator, Still())
    update(game.batch, players, Judges(), LossWeights(), PLAIN, adversarial=True)
    assert left and all(gradient is None for gradient in left)


def test_the_generator_hears_the_discriminator() -> None:
    game = Game("warp")
    before = copy(game.model)
    assert set(game.update(Judges(None, None), adversarial=True)) == {
        *("adversarial", "discriminator", "total"),
    }
    assert game.changed(before, game.model) == {"render_net"}


@pytest.fixture
def face_iuv() -> Tensor:
    """A head seen from the front in the middle of 96 x 96 px, of the places of a face."""
    part, v, u = face_table().nonzero().unbind(1)
    chosen = torch.arange(24 * 24) * (len(part) // (24 * 24))
    iuv = torch.zeros(1, 3, 96, 96, dtype=torch.uint8)
    for channel, values in enumerate((part, u, v)):
        iuv[0, channel, 36:60, 36:60] = values[chosen].view(24, 24).to(torch.uint8)
    return iuv


class Still:
    """An optimiser that does nothing."""

    def step(self) -> None: ...
    def zero_grad(self) -> None: ...


def test_the_discriminator_learns_to_tell() -> None:
    game = Game()
    rest = Players(
        game.players.generator, Still(), game.discriminator, game.players.discriminator_optimiser
    )
    losses = []
    for _ in range(60):
        terms = update(game.batch, rest, Judges(Pixels()), LossWeights(), PLAIN, adversarial=True)
        game.model.zero_grad()
        losses.append(float(terms["discriminator"]))
    assert losses[-1] < 0.5 * losses[0]


def test_the_average_follows() -> None:
    game = Game()
    average = Average(deepcopy(game.model).requires_grad_(False), 0.999)
    before = copy(average.model)
    game.update()
    average.update(game.model, 1)
    after, live = average.model.state_dict(), game.model.state_dict()
    name = "render_net.layers.1.weight"
    expected = before[name] + (live[name] - before[name]) * (1 - 2 / 11)
    assert torch.allclose(after[name], expected, atol=1e-7)
    running = next(name for name in after if name.endswith("running_mean"))
    assert torch.equal(after[running], live[running])
    average.update(game.model, 1_000_000)
    assert torch.allclose(average.model.state_dict()[name], expected, atol=1e-4)


@pytest.mark.parametrize(
    ("settings", "remedies"),
    [
        ({"identity": "sphereface"}, ("--sphereface FILE", "--no-identity")),
        ({"identity": "dlib"}, ("mt models fetch --faces",)),
        (
            {"identity": "sphereface", "sphereface_file": "/nowhere.pth"},
            ("--sphereface FILE", "--no-identity"),
        ),
        ({"perceptual": "vgg19", "vgg19_file": "/nowhere"}, ("--vgg19 FILE", "--no-perceptual")),
        ({"perceptual": "vgg19"}, ("--vgg19 FILE", "--no-perceptual")),
    ],
)
def test_a_missing_network_is_an_error_with_its_way_out(
    settings: dict, remedies: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path))
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path))
    given = {"perceptual": "none", "identity": "none", **settings}
    with pytest.raises((WeightsError, InputError)) as caught:
        load_judges(LossSettings(**given))
    for remedy in remedies:
        assert remedy in str(caught.value)


def test_identity_by_dlib_looks_at_the_face_alone(face_iuv: Tensor) -> None:
    judge = dlib_identity(DlibFace())
    truth = torch.rand(1, 3, 96, 96) * 2 - 1
    drawn = truth.clone().requires_grad_()
    assert judge(drawn, truth, face_iuv) == 0
    other = (truth + 0.1 * torch.randn_like(truth)).requires_grad_()
    judge(other, truth, face_iuv).backward()
    assert other.grad is not None
    rows = other.grad.abs().sum((0, 1, 3)).nonzero().flatten()
    assert 0 < len(rows) < 96
    assert judge(torch.zeros_like(truth), truth, torch.zeros_like(face_iuv)) == 0


def test_left_out_losses_have_no_judge() -> None:
    assert load_judges(LossSettings(perceptual="none", identity="none")) == Judges(None, None)
