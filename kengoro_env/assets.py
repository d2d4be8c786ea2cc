"""Paths of the assets: beside this package in a checkout, inside it in an installed wheel."""

from pathlib import Path

from kengoro_env.errors import AssetError

_PACKAGE = Path(__file__).resolve().parent
_IN_WHEEL = _PACKAGE / "assets_data"
_IN_CHECKOUT = _PACKAGE.parent / "assets"


def assets_root() -> Path:
    """Absolute path of the assets folder.

    Raises:
        AssetError: the folder exists neither in a wheel nor in a checkout.
    """
    for root in (_IN_WHEEL, _IN_CHECKOUT):
        if root.is_dir():
            return root
    raise AssetError(
        f"The assets folder is missing: neither {_IN_WHEEL} (installed) nor {_IN_CHECKOUT}"
        " (checkout) exists; install the package again."
    )


def asset_path(name: str) -> Path:
    """Absolute path of an asset.

    Args:
        name: path of a file or folder relative to assets/, with forward slashes, such as
            ``"mjcf/kengoro_arm/arm.xml"``.

    Raises:
        AssetError: the asset does not exist, or ``name`` leads out of the folder.
    """
    root = assets_root()
    path = (root / name).resolve()
    if not path.is_relative_to(root.resolve()):
        raise AssetError(f"The asset {name!r} lies outside {root}: give a path relative to it.")
    if not path.exists():
        beside = path.parent
        while not beside.is_dir():
            beside = beside.parent
        valid = ", ".join(sorted(entry.name for entry in beside.iterdir())) or "nothing"
        raise AssetError(f"The asset {name!r} does not exist: {beside} holds {valid}.")
    return path
