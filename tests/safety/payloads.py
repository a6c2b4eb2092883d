"""Texts that other programs have executed when they came as configuration, and where a campaign may hold them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

# What other programs have executed when it came as configuration. CANARY is a file that must not appear, and `evil` a
# module beside the campaign that would make it.
PAYLOADS = (
    "__import__('os').system('touch CANARY')",
    "__import__('pathlib').Path('CANARY').touch()",
    "eval(open('CANARY', 'w'))",
    'exec(\'open(\\"CANARY\\", \\"w\\")\')',
    "().__class__.__bases__[0].__subclasses__()",
    "{0.__class__.__init__.__globals__}",
    "{self.__class__.__mro__}",
    "%(__class__)s%n%n%n",
    "${open('CANARY','w')}",
    "${oc.env:HOME}",
    "$(touch CANARY)",
    "`touch CANARY`",
    "; touch CANARY",
    "| touch CANARY",
    "&& touch CANARY",
    "|| touch CANARY #",
    "> CANARY",
    "$IFS;touch$IFS CANARY",
    "!!python/object/apply:os.system ['touch CANARY']",
    "!!python/object/new:os.system ['touch CANARY']",
    "!!python/name:evil.x",
    "!include evil.toml",
    "@evil",
    "evil",
    "evil:DETECTOR",
    "evil.DETECTOR",
    "evil:x",
    "os:system",
    "os.system",
    "builtins.exec",
    "survey_mc.cli:main",
    "./evil.py",
    "evil.py",
    "cos\\nsystem\\n(S'touch CANARY'\\ntR.",
    "gASVHgAAAAAAAACMBXBvc2l4lIwGc3lzdGVtlJOUjAV0b3VjaJSFlFKULg==",
    "{{ ''.__class__ }}{% raw %}",
    "<script>alert(1)</script>",
    "$\\\\input{/etc/passwd}$",
    "\\\\write18{touch CANARY}",
    "${jndi:ldap://localhost/x}",
    "=cmd|'/c touch CANARY'!A1",
    "'; import os; os.system('touch CANARY'); '",
    "lambda: open('CANARY', 'w')",
    "np.load('evil.npy')",
    "@__builtins__.open('CANARY', 'w')",
    "file:///proc/self/exe",
)
# Where a text of a campaign may stand.
PLACES = {
    "name": ('name = "small"', 'name = "{}"'),
    "about": ('name = "small"', 'name = "small"\nabout = "{}"'),
    "label": ('label = "G"', 'label = "{}"'),
    "method": ('name = "gauss_se"', 'name = "{}"'),
    "profile": ('label = "G"', 'label = "G"\nprofile = "{}"'),
    "parameter": ('label = "G"', 'params = {{ fwhm_arcsec = "{}" }}'),
    "network": ('label = "G"', 'params = {{ stellarity_network = "{}" }}'),
    "parameter that is none": ('label = "G"', 'params = {{ "{}" = 1 }}'),
    "instrument": ('name = "xmm_epic"', 'name = "{}"'),
    "sky": ('kind = "lognlogs"', 'kind = "{}"'),
    "model": ('kind = "lognlogs"', 'kind = "lognlogs"\nmodel = "{}"'),
    "image": ('kind = "lognlogs"\nflux_min_cgs = 1e-15', 'kind = "image"\nscale_arcsec = 4.0\npath = "{}"'),
    "number": ("flux_min_cgs = 1e-15", 'flux_min_cgs = "{}"'),
    "unit": ("[10.0]", '["10 {}"]'),
    "band": ('["soft"]', '["{}"]'),
    "rule": ("counts_min = 10", 'counts_min = 10\nrule = "{}"'),
    "exposure": ("counts_min = 10", 'counts_min = {{ "{}" = 10 }}'),
    "target": ("seed = 7", 'seed = 7\n_target_ = "{}"'),
    "table": ("[store]", '["{}"]'),
}


def quoted(payload: str) -> str:
    """The payload as it stands between the quotes of a TOML text."""
    return payload.replace('"', '\\"') if '\\"' not in payload else payload


def campaigns_with(payload: str, text: str, every: int = 1, first: int = 0) -> Iterator[str]:
    """Campaign texts with the payload in one place each; every, first: of all places only some."""
    for old, new in list(PLACES.values())[first % every :: every]:
        assert old in text
        yield text.replace(old, new.format(quoted(payload)))


# Modules that Python, dask or we import, to be planted where a campaign lies.
TEMPTING_NAMES = (
    "json", "random", "multiprocessing", "numba", "astropy", "pandas", "pyarrow", "matplotlib", "yaml", "dask", "numpy",
    "distributed", "scipy", "sep", "pydantic", "click", "rich", "survey_mc", "sitecustomize", "usercustomize", "typing",
    "contextlib", "ctypes", "conftest", "threading", "socket", "psutil", "tornado", "msgpack", "cloudpickle", "signal",
)  # fmt: skip
LAUNCHER = "import sys\nfrom survey_mc.cli import main\nif __name__ == '__main__':\n    sys.exit(main())\n"


def launcher(folder: Path) -> list[str]:
    """The command as it is installed: a script in a folder of its own; the current folder is not on the path."""
    script = folder / "bin" / "survey-mc"
    script.parent.mkdir(exist_ok=True)
    script.write_text(LAUNCHER)
    return [sys.executable, str(script)]
