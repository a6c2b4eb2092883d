"""Inputs that ask for more than any machine has, by name: small to write, and refused by a stated limit.

Every builder makes its input in a folder and returns the arguments of the command that is to refuse it.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable
from pathlib import Path

from small_campaigns import TEXT

OLD_SKY = 'kind = "lognlogs"\nflux_min_cgs = 1e-15'
GIGABYTE = 2**30
Builder = Callable[[Path], tuple[str, ...]]


def _campaign(*changes: tuple[str, str], extra: str = "") -> Builder:
    def build(folder: Path) -> tuple[str, ...]:
        text = TEXT
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        (folder / "c.toml").write_text(text + extra)
        return ("validate", str(folder / "c.toml"))

    return build


def _toml(text: str) -> Builder:
    def build(folder: Path) -> tuple[str, ...]:
        (folder / "c.toml").write_text(text)
        return ("validate", str(folder / "c.toml"))

    return build


def _sparse(name: str, size: int, *words: str, change: tuple[str, str] | None = None) -> Builder:
    """A file of `size` bytes that takes no room on the disk, named by a command or by a campaign."""

    def build(folder: Path) -> tuple[str, ...]:
        with (folder / name).open("wb") as stream:
            stream.truncate(size)
        if change is not None:
            (folder / "c.toml").write_text(TEXT.replace(*change))
        return tuple(str(folder / word) if "." in word else word for word in words)

    return build


def card(key: str, value: object) -> str:
    """A FITS card; texts as they are, quotes and all."""
    return f"{key:<8}= {value:>20}".ljust(80)


def header(*cards: str) -> bytes:
    """Header blocks with END."""
    text = "".join(cards) + "END".ljust(80)
    return text.ljust(-(-len(text) // 2880) * 2880).encode()


def _image(*axes: int, bits: int = 16, more: tuple[str, ...] = ()) -> bytes:
    sizes = [card(f"NAXIS{number}", length) for number, length in enumerate(axes, start=1)]
    return header(card("SIMPLE", "T"), card("BITPIX", bits), card("NAXIS", len(axes)), *sizes, *more)


def _packed(head: bytes, n_zeros: int) -> bytes:
    packer = zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS | 16)
    parts = [packer.compress(head)]
    parts += [packer.compress(bytes(2**20)) for _ in range(n_zeros // 2**20)]
    return b"".join((*parts, packer.flush()))


def _fits(content: Callable[[], bytes], name: str = "bomb.fits") -> Builder:
    def build(folder: Path) -> tuple[str, ...]:
        (folder / name).write_bytes(content())
        return ("detect", str(folder / name), "--method", "gauss_se", "--out", str(folder / "found.fits"))

    return build


def _exposure(bunit: str) -> Builder:
    """A good image with an exposure map whose unit is a sum."""

    def build(folder: Path) -> tuple[str, ...]:
        pixels = bytes(2 * 64 * 64).ljust(8640, b"\0")
        (folder / "good.fits").write_bytes(_image(64, 64) + pixels)
        (folder / "map.fits").write_bytes(_image(64, 64, more=(f"BUNIT   = '{bunit}'".ljust(80),)) + pixels)
        words = ("--exposure", str(folder / "map.fits"), "--pixel-scale", "4", "--out", str(folder / "found.fits"))
        return ("detect", str(folder / "good.fits"), *words)

    return build


def _extensions(n_cards: int, n_units: int) -> bytes:
    """Packed units with headers only: kilobytes that unpack to thousands of cards each."""
    empty = (card("BITPIX", 8), card("NAXIS", 0), card("PCOUNT", 0), card("GCOUNT", 1))
    unit = header("XTENSION= 'IMAGE   '".ljust(80), *empty, *(card(f"K{number}", number) for number in range(n_cards)))
    return gzip.compress(header(card("SIMPLE", "T"), card("BITPIX", 8), card("NAXIS", 0)) + unit * n_units, 1)


NETWORK = ('label = "G"', 'params = { stellarity_network = "big.nnw" }')
IMAGE = (OLD_SKY, 'kind = "image"\npath = "big.fits"\nscale_arcsec = 4.0')
WIDE = ("n_pix = 128", "n_pix = 512\nscale_arcsec = 8.0\nvignetting = false")
THOUSAND = [float(number + 1) for number in range(1000)]
NESTED_KEY = "\n".join(f"a{number}." + "a." * 28 + "a = 1" for number in range(1400))

# What is to be refused, and a word of the sentence that names the limit or the place.
CAMPAIGNS: dict[str, tuple[Builder, str]] = {
    "1e18 realisations": (_campaign(("= 6", f"= {10**18}")), "less than or equal to 10000000"),
    "2**63 realisations": (_campaign(("= 6", f"= {2**63}")), "64 bits"),
    "a seed of 900 digits": (_campaign(("seed = 7", "seed = " + "9" * 900)), "64 bits"),
    "a seed of 90000 digits": (_campaign(("seed = 7", "seed = " + "9" * 90_000)), "line 4: has a number"),
    "a seed of 90000 hexadecimal digits": (_campaign(("seed = 7", "seed = 0x" + "f" * 90_000)), "64 bits"),
    "14000 exposures": (_campaign(("[10.0]", f"{THOUSAND * 14}")), "at most 1000 entries"),
    "1001 exposures": (_campaign(("[10.0]", f"{[*THOUSAND, 5000.0]}")), "at most 1000 entries"),
    "1000 cells of 100 methods": (
        _campaign(
            ("[10.0]", f"{THOUSAND}"),
            extra="".join(f'\n[[method]]\nname = "gauss_se"\nlabel = "{n}"' for n in range(99)),
        ),
        "at most 10000 are allowed",
    ),
    "1e7 fields in files of one": (_campaign(("= 6", "= 9000000"), ("_file = 4", "_file = 1")), "at most 1000000"),
    "a thousand million pixels a field": (_campaign(("n_pix = 128", "n_pix = 31623")), "4096"),
    "pixels of 1e-300 arcsec": (_campaign(("n_pix = 128", "n_pix = 128\nscale_arcsec = 1e-300")), "scale_arcsec"),
    "1e400 exposures": (_campaign(("[10.0]", "[1e400]")), "finite"),
    "a negative infinity": (_campaign(("[10.0]", "[-inf]")), "inf"),
    "not a number": (_campaign(("flux_min_cgs = 1e-15", "flux_min_cgs = nan")), "nan"),
    "minus zero": (_campaign(("[10.0]", "[-0.0]")), "greater than 0"),
    "a flux of 1e-320": (_campaign(("1e-15", "1e-320")), "flux_min_cgs"),
    "sources without number": (
        _campaign(("n_pix = 128", "n_pix = 512\nscale_arcsec = 60.0\nvignetting = false"), ("1e-15", "1e-18")),
        "at most 1e+06",
    ),
    "photons without number": (
        _campaign(("n_pix = 128", "n_pix = 128\nbackground_cps_per_pix = { soft = 1e300 }")),
        "5e+07",
    ),
    "files of more sources than memory": (
        _campaign(WIDE, ("1e-15", "1e-16"), ("_file = 4", "_file = 9999")),
        "store.realisations_per_file: gives",
    ),
    "links of everything with everything": (
        _campaign(WIDE, ("1e-15", "1e-17"), ("counts_min = 10", "counts_min = 10\nlink_radius_arcsec = 3600.0")),
        "match.link_radius_arcsec: gives",
    ),
    "a power of a power": (_campaign(("[10.0]", '["1 10^1000000000 s"]')), "must be a time"),
    "a power in brackets": (_campaign(("[10.0]", '["1 (10**999999999)**999999999 s"]')), "must be a time"),
    "powers of powers": (_campaign(("[10.0]", '["1 ' + "(" * 12 + "10" + "^99)" * 12 + ' s"]')), "must be a time"),
    "9000 rows of 9000 pairs": (
        _campaign((OLD_SKY, f'kind = "pair_rows"\ncounts = {[1] * 9000}\nseparations_arcsec = {[1] * 9000}')),
        "at most 1000 entries",
    ),
    "1000 clusters in a nutshell": (
        _campaign((OLD_SKY, f'kind = "clusters"\nredshifts = {[1.0] * 1000}\nradius_arcmin = 4.0')),
        "do not fit",
    ),
    "brackets 40000 deep": (_toml("a = " + "[" * 40_000), "line 1: is nested more than 32"),
    "tables 20000 deep": (_toml("a = " + "{a=" * 20_000), "line 1: is nested more than 32"),
    "a million levels of brackets": (_toml("a = " + "[" * 10**6), "at most 100000 bytes"),
    "a key of 40000 parts": (_toml("a" + ".a" * 40_000 + " = 1"), "line 1: has more than 200 dots"),
    "1400 keys of 30 parts": (_toml(NESTED_KEY), "at most 1000 entries"),
    "16000 empty tables": (_toml("\n".join("[[t]]" for _ in range(16_000))), "at most 1000 entries"),
    "a text of 90000 lines": (_toml('name = """' + "\n" * 90_000 + '"""'), "is missing"),
    "a text of 90000 quotes": (_toml('"' * 90_000), "line 1"),
    "a text of 90000 backslashes": (_toml('a = "' + "\\" * 90_000 + '"'), "is not a known key"),
    "90000 blanks in a number": (_campaign(("[10.0]", '["1 ' + " " * 90_000 + 'x s"]')), "must be a time"),
    "10000 unknown keys": (_toml("\n".join(f"k{n}=1" for n in range(10_000))), "at most 1000 entries"),
    "a file of 2 MB": (_toml("#" * 2_000_000), "at most 100000 bytes"),
    "a sparse campaign of 4 GB": (_sparse("c.toml", 4 * GIGABYTE, "validate", "c.toml"), "at most 100000 bytes"),
    "a sparse network of 4 GB": (
        _sparse("big.nnw", 4 * GIGABYTE, "validate", "c.toml", change=NETWORK),
        "at most 537919488",
    ),
    "a sparse sky image of 4 GB": (
        _sparse("big.fits", 4 * GIGABYTE, "validate", "c.toml", change=IMAGE),
        "at most 537919488",
    ),
}  # fmt: skip
IMAGES: dict[str, tuple[Builder, str]] = {
    "a header of a thousand million pixels": (_fits(lambda: _image(31623, 31623)), "at most 67108864"),
    "999 axes of 9e18": (_fits(lambda: _image(*[9 * 10**18] * 999)), "bytes fit any file"),
    "999 axes of -9e18": (_fits(lambda: _image(*[-9 * 10**18] * 999)), "0 or more"),
    "a PCOUNT of 60 digits": (_fits(lambda: _image(8, 8, more=(card("PCOUNT", 10**60),))), "bytes fit any file"),
    "an axis of 2**62": (_fits(lambda: _image(2**62, 0)), "empty"),
    "promised data that are not there": (_fits(lambda: _image(8192, 8192)), "truncated"),
    "a packed thousand million pixels": (
        _fits(lambda: _packed(_image(32768, 32767, bits=8), 2**24), "bomb.fits.gz"),
        "at most 67108864",
    ),
    "a packed gigabyte to pass over": (
        _fits(
            lambda: _packed(
                _image() + header("XTENSION= 'BINTABLE'".ljust(80), card("BITPIX", 8), card("NAXIS", 2),
                                  card("NAXIS1", 32768), card("NAXIS2", 32768), card("PCOUNT", 0), card("GCOUNT", 1)),
                2**24,
            ),
            "bomb.fits.gz",
        ),
        "at most 536870912",
    ),
    "a packed header without end": (_fits(lambda: _packed(_image(8, 8)[:-2880], 2**26), "bomb.fits.gz"), "SIMPLE"),
    "a header without END": (_fits(lambda: _image(8, 8).replace(b"END", b"   ") + b" " * 2880 * 1001), "no END card"),
    "packed in packed": (_fits(lambda: gzip.compress(_packed(_image(8, 8), 2**24)), "bomb.fits.gz"), "SIMPLE"),
    "140000 cards in 4 units": (_fits(lambda: _extensions(35_000, 4), "bomb.fits.gz"), "more than 8640000 bytes"),
    "2100 units": (_fits(lambda: _extensions(0, 2100), "bomb.fits.gz"), "more than"),
    "3500 projection parameters": (
        _fits(
            lambda: _image(8, 8, more=("CTYPE1  = 'RA---ZPN'".ljust(80), *(card(f"PV2_{n}", 1) for n in range(3500))))
            + bytes(2880)
        ),
        "more than 100 projection parameters",
    ),
    "a sparse file of 4 GB": (_sparse("big.fits", 4 * GIGABYTE, "detect", "big.fits", "--out", "found.fits"), "SIMPLE"),
    "a unit that is a sum": (_exposure("10**1000000000 s"), "unit must be one of"),
}  # fmt: skip
BOMBS = CAMPAIGNS | IMAGES
