"""Mutated campaign files and FITS headers: what typing errors, broken disks and malice make of good ones."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
from small_campaigns import MR1, TEXT

from survey_mc.detect import DETECTORS, Detector

BLOCK, CARD = 2880, 80

# Values that a key may be given instead of its own.
NASTY_VALUES = (
    *r"""
1e400|-1e400|inf|-inf|nan|-nan|-0.0|0|-1|1e-320|1e308|1e-16|64|2048|0.5|1000001|1_000_000|1000000000000000000
9223372036854775807|9223372036854775808|-9223372036854775809|0x7fffffffffffffff|0xffffffffffffffffffff|true|false
""|"x"|'../x'|"\u0000"|"\u202e"|"a\nb"|"é\u0301"|"1 ks"|"10^999999999 s"|"1 10^999999999 s"|"1e400 s"|"nan s"|"1 parsec"
1979-05-27|1979-05-27T07:32:00Z|07:32:00|[]|{}|[[]]|[1, 2, 3]|["soft", "hard"]|["soft", "soft"]|[nan]|[inf, -inf]
{ soft = 1, hard = 2 }|{ kind = 'image' }|[1, 'a', true, []]|{ '' = 1 }|{ 10 = 10, 100 = 30 }|"gauss_se"|"hard"
""".strip()
    .replace("\n", "|")
    .split("|"),
    "'''\n'''",
    "[" + "1, " * 1200 + "1]",
    '"' + "9" * 300 + '"',
    "1" * 5000,
)
TOKENS = (
    *("[", "]", "{", "}", "=", ",", ".", '"', "'", "'''", "#", "\\", "\\u", "é", "[[", "]]", "[grid]", "[[method]]"),
    *(
        "[sky]",
        "==",
        "0x",
        "1e",
        "--",
        "+",
        "_",
        "inf",
        "nan",
        "a.b.c",
        '"""',
        "\n",
        "\r",
        "\r\n",
        "\t",
        "\x00",
        "\x7f",
        "\u2028",
        "\ufeff",
    ),
)
NEW_KEYS = ("seed", "path", "n_pix", "about", "params", "__class__", "'a b'", "é", "a.b", "''", "include", "kind")
SKIES = (
    'kind = "lognlogs"\nflux_min_cgs = 1e-15\nmodel = { soft = "hasinger1998", hard = "giacconi2001" }',
    'kind = "pair_rows"\nseparations_arcsec = [15.0, 30.0]\ncounts = [50.0, 200.0]\npair_spacing_arcmin = 2.0',
    'kind = "flux_grid"\nfluxes_cgs = [1e-14, 1e-13]\nradius_arcmin = 4.0\nsource = "extended"',
    'kind = "clusters"\nredshifts = [0.6, 1.0]\nradius_arcmin = 3.0\nmin_separation_arcmin = 1.0\nbeta = 0.7',
    'kind = "combined"\nparts = [{ kind = "lognlogs", flux_min_cgs = 1e-15 }, { kind = "clusters", redshifts = [1.0],'
    " radius_arcmin = 2.0 }]",
    'kind = "empty"',
)
MORE = (
    "\npsf_fwhm_arcsec = 6.0\npsf_hew_arcsec = 15.0\nvignetting = true\ngrants_background = false\nscale_arcsec = 4.0"
)
_OLD_SKY = 'kind = "lognlogs"\nflux_min_cgs = 1e-15'


def seeds() -> tuple[str, ...]:
    """Good campaigns that between them have most of the keys."""
    texts = [TEXT.replace(_OLD_SKY, sky).replace("n_pix = 128", "n_pix = 128" + MORE) for sky in SKIES]
    chosen = [_method(detector) for detector in DETECTORS.built_in]
    return tuple(text + extra for text in texts for extra in ("", MR1, *chosen))


def _method(detector: Detector) -> str:
    """A [[method]] with every parameter spelt out, as it is in the profile for tests."""
    given = detector.tiny.model_dump(mode="json", exclude_none=True)
    lines = [f"{key} = {json.dumps(value)}" for key, value in given.items() if not isinstance(value, dict)]
    return f'\n[[method]]\nname = "{detector.name}"\n[method.params]\n' + "\n".join(lines) + "\n"


def mutated_campaign(rng: random.Random, texts: tuple[str, ...]) -> bytes:
    """A campaign file with one to four changes; often still TOML, sometimes still a campaign."""
    text = rng.choice(texts)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
        text = rng.choice(_TEXT_CHANGES)(text, rng)
    content = text.encode("utf-8", "surrogatepass")
    return _flip_bytes(content, rng) if rng.random() < 0.1 else content


def _nasty_value(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    places = [i for i, line in enumerate(lines) if "=" in line]
    if places:
        place = rng.choice(places)
        lines[place] = lines[place].partition("=")[0] + "= " + rng.choice(NASTY_VALUES)
    return "\n".join(lines)


def _new_key(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    key = rng.choice(
        ("seed", "path", "n_pix", "about", "params", "__class__", "'a b'", "é", "a.b", "''", "include", "kind")
    )
    lines.insert(rng.randrange(len(lines) + 1), f"{key} = {rng.choice(NASTY_VALUES)}")
    return "\n".join(lines)


def _lost_line(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    del lines[rng.randrange(len(lines))]
    return "\n".join(lines)


def _moved_line(text: str, rng: random.Random) -> str:
    lines = text.split("\n")
    lines.insert(rng.randrange(len(lines) + 1), lines[rng.randrange(len(lines))])
    return "\n".join(lines)


def _token(text: str, rng: random.Random) -> str:
    place = rng.randrange(len(text) + 1)
    return text[:place] + rng.choice(TOKENS) + text[place + rng.choice((0, 0, 1, 3)) :]


def _cut(text: str, rng: random.Random) -> str:
    start = rng.randrange(len(text) + 1)
    return text[:start] if rng.random() < 0.5 else text[:start] + text[start + rng.randrange(40) :]


def _misspelt(text: str, rng: random.Random) -> str:
    places = [i for i, letter in enumerate(text) if letter.isalpha()]
    if not places:
        return text
    place = rng.choice(places)
    return text[:place] + rng.choice("abcxyzXYZ_-") + text[place + 1 :]


def _number(text: str, rng: random.Random) -> str:
    """Another digit, sign or power of ten somewhere."""
    places = [i for i, letter in enumerate(text) if letter.isdigit()]
    if not places:
        return text
    place = rng.choice(places)
    return text[:place] + rng.choice(("9", "0", "-", "1e9", "e-9", "00000", "9" * 20, ".", "1e300")) + text[place + 1 :]


_TEXT_CHANGES: tuple[Callable[[str, random.Random], str], ...] = (
    *(_nasty_value, _nasty_value, _nasty_value, _number, _number, _new_key),
    *(_lost_line, _moved_line, _token, _cut, _misspelt),
)


def _flip_bytes(content: bytes, rng: random.Random) -> bytes:
    changed = bytearray(content or b"x")
    for _ in range(rng.randrange(1, 4)):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


# Cards that a FITS file may have instead of, or besides, its own.
# {n}: a number, {x}: a fraction, {s}: a word, {u}: a unit, {p}: a projection.
CARDS = tuple(
    """
NAXIS   = {n}|NAXIS1  = {n}|NAXIS2  = {n}|NAXIS3  = {n}|BITPIX  = {n}|BLANK   = {n}|PCOUNT  = {n}|GCOUNT  = {n}|END
BSCALE  = {x}|BZERO   = {x}|CRPIX1  = {x}|CRVAL1  = {x}|CRVAL2  = {x}|CDELT1  = {x}|CDELT2  = {x}|CD1_1   = {x}
CD1_2   = {x}|CD2_2   = {x}|PC1_1   = {x}|CROTA2  = {x}|PV2_1   = {x}|LONPOLE = {x}|LATPOLE = {x}|EQUINOX = {x}|END
A_ORDER = {n}|A_0_2   = {x}|CTYPE1  = '{s}'|CTYPE2  = '{s}'|CTYPE1  = 'RA---{p}'|CTYPE2  = 'DEC--{p}'|CUNIT1  = '{u}'
BUNIT   = '{u}'|RADESYS = '{s}'|EXPOSURE= {x}|ONTIME  = {x}|E_MIN   = {x}|E_MAX   = {x}|PIMIN   = {n}
RA_PNT  = {x}|SIMPLE  = F|DEC_PNT = {x}|TELESCOP= '{s}'|OBJECT  = '{s}'|EXTNAME = '{s}'|CHECKSUM= '{s}'|DATASUM = '{s}'
DSTYP1  = 'PI'|TFIELDS = {n}
EXTEND  = F|GROUPS  = T|DSVAL1  = '{s}'|XTENSION= '{s}'|ZIMAGE  = T|CONTINUE  '{s}&'|HIERARCH A B = {x}
COMMENT {s}|TFIELDS = {n}|CRPIX1  = '{s}'|NAXIS   = {x}|EXPOSURE= (1.0, 2.0)|
""".strip()
    .replace("\n", "|")
    .split("|")
)
NUMBERS = ("0", "1", "-1", "2", "3", "32", "999", "1000", "2147483648", "9223372036854775807", "9" * 60, "-9" * 20, "?")
FRACTIONS = ("0.0", "-0.0", "1.0", "1E-300", "1E300", "1E999", "-1E-5", "NAN", "INF", "90.0", "-91.0", "1D3", "1,5")
WORDS = (
    "",
    "x",
    "FOO",
    "RA---TAN",
    "GLON-CAR",
    "HPLN-TAN",
    "IMAGE",
    "BINTABLE",
    "é",
    "\x00",
    "''",
    "&",
    "a" * 68,
    "0:9",
)
PROJECTIONS = ("TAN", "SIN", "ZPN", "TPV", "TAN-SIP", "TAB", "HPX", "CAR", "AIT", "BON", "XXX")
UNITS = ("s", "ks", "deg", "count/pixel", "10**1000000000 s", "(10^99)^99", "cm**2 s", "((((", "1/0", "mag(s)", "")


def mutated_fits(whole: bytes, n_header: int, rng: np.random.Generator) -> bytes:
    """A file with flipped bits, foreign cards, lost or doubled cards in its first `n_header` bytes, or cut short."""
    changed = bytearray(whole)
    n_cards = n_header // CARD
    for _ in range(rng.integers(1, 5)):
        place = int(rng.integers(0, n_cards)) * CARD
        match int(rng.integers(0, 10)):
            case 0:
                changed[int(rng.integers(0, n_header))] ^= 1 << int(rng.integers(0, 8))
            case 1:
                other = int(rng.integers(0, n_cards)) * CARD
                changed[place : place + CARD] = changed[other : other + CARD]
            case 2:
                del changed[place : place + CARD]
                changed[n_header - CARD : n_header - CARD] = b" " * CARD
            case 3 if rng.random() < 0.3:
                del changed[int(rng.integers(1, len(changed))) :]
                changed += b" " * max(0, n_header - len(changed))
            case 4:
                changed[place + 10 : place + 30] = f"{_pick(NUMBERS + FRACTIONS, rng):>20.20}".encode(
                    "ascii", "replace"
                )
            case _:
                changed[place : place + CARD] = foreign_card(rng)
    return bytes(changed)


def foreign_card(rng: np.random.Generator) -> bytes:
    """One card with a value that it should not have."""
    choices = {"n": NUMBERS, "x": FRACTIONS, "s": WORDS, "u": UNITS, "p": PROJECTIONS}
    text = _pick(CARDS, rng).format(**{letter: _pick(values, rng) for letter, values in choices.items()})
    return text.encode("latin-1")[:CARD].ljust(CARD)


def _pick(choices: tuple[str, ...], rng: np.random.Generator) -> str:
    return choices[int(rng.integers(0, len(choices)))]


def good_fits(folder: Path) -> list[tuple[bytes, int]]:
    """Images with all that headers say, in the primary unit and in an extension; their bytes and length of headers."""
    from astropy.io import fits

    rng = np.random.default_rng(29)
    counts = rng.poisson(0.5, (64, 64)).astype(np.int32)
    cards = {f"{key}{axis}": value for key, value in (("CRPIX", 32.5), ("CUNIT", "deg")) for axis in (1, 2)}
    cards |= {"CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRVAL1": 150.1, "CRVAL2": 2.2, "RADESYS": "FK5"}
    cards |= {"CDELT1": -4.0 / 3600.0, "CDELT2": 4.0 / 3600.0, "EQUINOX": 2000.0, "RA_PNT": 150.1, "DEC_PNT": 2.2}
    cards |= {"EXPOSURE": 1e4, "E_MIN": 0.5, "E_MAX": 2.0, "E_UNIT": "keV", "BUNIT": "count", "TELESCOP": "XMM"}
    made = []
    for number, extension in enumerate((False, True)):
        header = fits.Header(cards)
        image = fits.ImageHDU(counts, header, name="SCI") if extension else fits.PrimaryHDU(counts, header)
        units = fits.HDUList([fits.PrimaryHDU(), image] if extension else [image])
        path = folder / f"good{number}.fits"
        units.writeto(path, overwrite=True, checksum=bool(number))
        made.append((path.read_bytes(), BLOCK * (2 if extension else 1)))
    return made
