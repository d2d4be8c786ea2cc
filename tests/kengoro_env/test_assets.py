"""Assets are found in a checkout and in an installed package; errors name missing ones."""

from pathlib import Path

import pytest

from kengoro_env import assets
from kengoro_env.errors import KengoroError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The assets folder as in an installed wheel, with one file `mjcf/arm.xml`."""
    root = tmp_path / "kengoro_env" / "assets_data"
    (root / "mjcf").mkdir(parents=True)
    (root / "mjcf" / "arm.xml").touch()
    monkeypatch.setattr(assets, "_IN_WHEEL", root)
    monkeypatch.setattr(assets, "_IN_CHECKOUT", tmp_path / "assets")
    return root


def test_checkout() -> None:
    arm = ROOT / "assets" / "mjcf" / "kengoro_arm" / "arm.xml"
    assert assets.asset_path("mjcf/kengoro_arm/arm.xml") == arm


def test_installed_package(installed: Path) -> None:
    assert assets.asset_path("mjcf/arm.xml") == installed / "mjcf" / "arm.xml"


def test_folder(installed: Path) -> None:
    assert assets.asset_path("mjcf") == installed / "mjcf"


@pytest.mark.parametrize("name", ["mjcf/leg.xml", "mjcf/leg/knee.xml", "mjcf/arm.xml/more"])
def test_the_error_of_a_missing_asset_lists_the_assets(installed: Path, name: str) -> None:
    with pytest.raises(KengoroError, match=r"does not exist: .*mjcf holds arm\.xml\.") as caught:
        assets.asset_path(name)
    assert repr(name) in str(caught.value)


@pytest.mark.parametrize("name", ["../errors.py", "/etc", "mjcf/../../errors.py"])
def test_asset_outside_the_folder(installed: Path, name: str) -> None:
    with pytest.raises(KengoroError, match="lies outside"):
        assets.asset_path(name)


def test_no_assets_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assets, "_IN_WHEEL", tmp_path / "a")
    monkeypatch.setattr(assets, "_IN_CHECKOUT", tmp_path / "b")
    with pytest.raises(KengoroError, match="install the package again"):
        assets.asset_path("mjcf/kengoro_arm/arm.xml")
