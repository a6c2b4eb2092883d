"""The style sheet of the report: readable, printable, light and dark."""

STYLE = """
:root { color-scheme: light dark; --ink: #1d2330; --soft: #5b6475; --paper: #fdfdfb; --card: #ffffff; --line: #dfe2e8;
  --accent: #0b5d8f; --band: #f2f5f8; --warn: #fff4d6; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e9ef; --soft: #a3adbd; --paper: #14171d; --card: #1b1f27;
  --line: #333a46; --accent: #7cc4f2; --band: #222833; --warn: #3a3113; } }
* { box-sizing: border-box; }
html { scroll-behavior: smooth; scroll-padding-top: 1rem; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.6 system-ui, "Segoe UI", Roboto,
  "Helvetica Neue", sans-serif; }
.sheet { display: grid; grid-template-columns: 14rem minmax(0, 62rem); gap: 3rem; max-width: 82rem; margin: 0 auto;
  padding: 2.5rem 1.5rem 5rem; }
nav { position: sticky; top: 2rem; align-self: start; font-size: .875rem; max-height: calc(100vh - 4rem);
  overflow: auto; }
nav ol { list-style: none; margin: .5rem 0 0; padding: 0; border-left: 2px solid var(--line); }
nav li a { display: block; padding: .2rem 0 .2rem .9rem; color: var(--soft); text-decoration: none; }
nav li a:hover { color: var(--accent); }
nav ol ol { border: 0; margin: 0; padding-left: .9rem; }
h1 { font-size: 2.1rem; line-height: 1.2; margin: 0 0 .4rem; letter-spacing: -.015em; overflow-wrap: anywhere; }
h2 { font-size: 1.35rem; margin: 3.2rem 0 .8rem; padding-top: 1.2rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.02rem; margin: 2rem 0 .5rem; }
p, dd, li { max-width: 46rem; }
a { color: var(--accent); }
.lead { font-size: 1.08rem; color: var(--soft); margin: 0 0 1.2rem; }
.facts { display: flex; flex-wrap: wrap; gap: .4rem 1.6rem; margin: 0; padding: 0; list-style: none; color: var(--soft);
  font-size: .9rem; }
.facts b { color: var(--ink); font-weight: 600; }
.notice { background: var(--warn); border-radius: .5rem; padding: .7rem 1rem; margin: 1.2rem 0; font-size: .92rem; }
.notice ul { margin: .2rem 0 0; padding-left: 1.2rem; }
.wide { overflow-x: auto; margin: 1rem 0; border: 1px solid var(--line); border-radius: .6rem;
  background: var(--card); }
table { border-collapse: collapse; width: 100%; font-size: .84rem; font-variant-numeric: tabular-nums; }
th, td { padding: .42rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
thead th { white-space: normal; font-weight: 600; vertical-align: bottom; background: var(--band); line-height: 1.3; }
small { font-weight: 400; color: var(--soft); font-size: .82em; }
table.headline :is(td, th) { line-height: 1.25; padding: .35rem .5rem; }
tbody th { font-weight: 500; }
tr.group th { text-align: left; background: var(--band); font-weight: 600; white-space: normal; }
tbody:last-child tr:last-child > * { border-bottom: 0; }
tbody tr:not(.group):hover { background: var(--band); }
table.plain td, table.plain th { text-align: left; white-space: normal; vertical-align: top; }
figure { margin: 1rem 0 2.2rem; }
figure img { display: block; width: 100%; height: auto; background: #fff; border: 1px solid var(--line);
  border-radius: .6rem; padding: .6rem; }
figcaption { font-size: .88rem; color: var(--soft); margin-top: .6rem; max-width: 52rem; }
dt { font-weight: 600; margin-top: .9rem; }
dd { margin: .15rem 0 0; color: var(--soft); }
pre { background: var(--band); border: 1px solid var(--line); border-radius: .6rem; padding: .9rem 1.1rem;
  overflow-x: auto;  font: .8rem/1.5 ui-monospace, "SF Mono", Menlo, Consolas, monospace; }
code { font: .88em ui-monospace, "SF Mono", Menlo, Consolas, monospace; overflow-wrap: anywhere; }
details summary { cursor: pointer; color: var(--accent); }
@media (max-width: 60rem) { .sheet { grid-template-columns: 1fr; gap: 1rem; }
  nav { position: static; max-height: none; } }
@media print { :root { --paper: #fff; --card: #fff; --ink: #000; --soft: #444; --line: #ccc; --band: #f3f3f3; }
  body { font-size: 10.5pt; } nav { display: none; } .sheet { display: block; padding: 0; } .wide { overflow: visible; }
  th, td { white-space: normal; padding: .25rem .35rem; } figure, tr { break-inside: avoid; }
  details > pre { display: block; } }
"""
