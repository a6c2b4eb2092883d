"""The named options: what else the paper's words or programs could have meant, each with a way to measure it.

Idea     an option turns the view of a base statistic into another one: another campaign on the same fields, another
         method label, matching rule, denominator, or reading of the words. Nothing is tuned: an option is a setting or
         reading that has a name, its effect is what it is.
Source   the paper's own contradictions and silences: two core radii, counts shown in figures only, an undefined "one
         sigma", a logN–logS "latest" of three references, program versions and defaults that are not printed.
Limits   options are taken one at a time.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any

from survey_mc.paper.statistics.statistic import Statistic
from survey_mc.paper.study import TEST_1, TEST_2, TEST_3, TEST_4, TEST_5
from survey_mc.paper.views import LABELS, SOFT_10, SOFT_100, View
from survey_mc.stats.false_detections import FALSE_STATUSES


@dataclass(frozen=True, slots=True)
class Option:
    """A named alternative. claims: patterns of the claims it can concern.

    campaigns: the campaign that takes the place of each base campaign; empty for all others staying. labels: the
    method label that takes the place of another, empty for all staying. cells: those the campaigns have; empty for
    all. changes: other fields of the view. is_diagnosis: it needs the origin of photons, which the paper did not have.
    """

    name: str
    about: str
    claims: tuple[str, ...]
    campaigns: Mapping[str, str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    cells: tuple[str, ...] = ()
    changes: Mapping[str, Any] = field(default_factory=dict)
    is_diagnosis: bool = False

    def applied(self, claim: str, view: View) -> View | None:
        """The view under this option; None if it does not concern the claim or changes nothing."""
        if not any(fnmatchcase(claim, pattern) for pattern in self.claims):
            return None
        if self.campaigns and view.campaign not in self.campaigns:
            return None
        if self.cells and not set(view.cells) <= set(self.cells):
            return None
        changed = replace(view, campaign=self.campaigns.get(view.campaign, view.campaign), **self.changes)
        if self.labels:
            if view.method not in self.labels or (len(view.methods) > 1 and not view.beside) or view.grid:
                return None
            return replace(changed, methods=(self.labels[view.method], *view.methods[1:]))
        if view.beside:
            changed = replace(changed, beside=self.campaigns.get(view.beside, view.beside))
        return changed if changed != view else None


MATCHED = ("test1.*", "test2.*", "test3.*", "test4.*.z*", "test5.*")
RATIOS = (
    "test1.dr60.*", "test1.ewav.loss", "test2.mr1.*", "test2.wav.*", "test3.wt.flux", "test3.eml.flux",
    "test4.*.ratio", "test5.photometry",
)  # fmt: skip
IN_VIGNETTED_FIELDS = ("test3.*.flux", "test4.*.ratio", "test5.photometry")
FALSE = ("test1.*.false", "test2.*.false", "test3.gse.false", "test5.eml.spurious")
FIELDS = ("test3.*", "test4.class.*", "test4.n_det", "test5.*", "cpu.*")

OF_MATCHING = (
    Option("match.rule = origin", "detections belong to the source whose photons they rest on", MATCHED,
           changes={"rule": "origin"}, is_diagnosis=True),
    Option("match.rule = nearest", "detections belong to the nearest listed source within the radius",
           ("test1.vtp.offset",), changes={"rule": "nearest"}),
    Option("match.radius_arcsec = 20", "the search radius of Test 2; the paper states none for Test 1", ("test1.*",),
           {TEST_1: "test1_wide_radius"}),
    Option("match.region_arcmin = whole image", "false detections of the whole image, not only inside 10′",
           ("test1.*.false", "test2.*.false"),
           {TEST_1: "test1_whole_image", TEST_2: "test2_whole_image"}),
    Option("match.region_arcmin = 15", "false detections out to the edge of the field of view, not only inside 10′",
           ("test1.*.false", "test2.*.false"), {TEST_1: "test1_whole_image", TEST_2: "test2_whole_image"},
           changes={"region_arcmin": 15.0}),
    Option("match.counts_min_on = counts_expected", "the input list is cut on vignetted counts", ("test5.*",),
           {TEST_5: "test5_expected_counts"}, cells=(SOFT_10, SOFT_100)),
    Option("false = spurious", "only detections that rest on no source count as false", FALSE,
           changes={"false": ("spurious",)}, is_diagnosis=True),
    Option("false = unmatched and duplicate", "a second detection of a source counts as false too", FALSE,
           changes={"false": (*FALSE_STATUSES, "duplicate")}),
)  # fmt: skip
OF_COUNTS = (
    Option("input = counts_expected", "ratios to the vignetted counts, and count limits on them",
           ("test3.*", *IN_VIGNETTED_FIELDS), changes={"input_counts": "counts_expected"}),
    Option("measured = corrected for vignetting", "measured counts divided by the vignetting at the detection",
           IN_VIGNETTED_FIELDS, changes={"measured_counts": "counts_corrected"}),
)  # fmt: skip
OF_SKIES = (
    Option("sky.counts = fainter pairs", "varying members of 10 to 200 instead of 20 to 500 counts", ("test1.*",),
           {TEST_1: "test1_fainter_pairs"}),
    Option("clusters.h_reading = text", "core radii of the text, twice those of Tab. 2", ("test2.*", "test4.*.z*"),
           {TEST_2: "test2_text_core_radius", TEST_4: "test4_text_core_radius"}),
    Option("sky.model.soft = giacconi2001", "soft logN–logS of Giacconi et al. 2001", FIELDS,
           {TEST_3: "test3_giacconi2001", TEST_5: "test5_giacconi2001"}, cells=(SOFT_10, SOFT_100)),
    Option("sky.model.soft = giacconi2001, instrument.field_of_view = false",
           "the same, and sources over the whole square", FIELDS,
           {TEST_3: "test3_giacconi2001_full_square", TEST_5: "test5_giacconi2001_full_square"},
           cells=(SOFT_10, SOFT_100)),
    Option("instrument.field_of_view = false", "nothing is cut at 15′", FIELDS, {TEST_3: "test3_full_square"}),
    Option("instrument.vignetting = false, field_of_view = false",
           "neither vignetting nor an edge, as in Tests 1 and 2", ("test4.*.z*",),
           {TEST_4: "test4_no_vignetting"}),
    Option("instrument.believed_psf = 4.3″ and 13.8″", "the procedures are told a narrower PSF than the image's",
           ("test1.*", "test3.*"), {TEST_1: "test1_believed_psf", TEST_3: "test3_believed_psf"}),
    Option("instrument.believed_psf = the image's", "the procedures are told the PSF of the image",
           ("test3.eml.flux",), {"test3_believed_psf": TEST_3}),
)  # fmt: skip

# Settings of the procedures: label in the option campaigns, name, sentence.
_EML, _VTP, _WAV, _EWAV, _GSE, _MR1 = LABELS.values()
_SETTINGS = (
    (_EML, "EMLDETECT correct scale", "emldetect.det_ml_scale = correct", "likelihoods without the old factor of two"),
    (_EML, "EMLDETECT six of one", "emldetect.n_max_fit = 6, n_mul_sou = 1", "six sources fitted at once, none split"),
    (_EML, "EMLDETECT points only", "emldetect.extent_model = none", "no extended model in the fit"),
    (_EML, "EMLDETECT modern", "emldetect profile = modern", "today's practice"),
    (_VTP, "VTPDETECT net counts", "vtpdetect.tested_counts = net", "significance of the net counts"),
    (_VTP, "VTPDETECT modern", "vtpdetect profile = modern", "today's practice"),
    (_WAV, "WAVDETECT own rings", "wavdetect.background_min_scale_pix = 0", "background from each scale's own ring"),
    (_WAV, "WAVDETECT wide cells", "wavdetect.psf_ecf = 0.6", "source cells with 60 % of the PSF"),
    (_WAV, "WAVDETECT modern", "wavdetect profile = modern", "today's practice"),
    (_EWAV, "EWAVELET 4 sigma", "ewavelet profile = paper_4sigma", "a threshold of 4σ instead of 1e-4"),
    (_EWAV, "EWAVELET corrected", "ewavelet profile = paper_corrected", "counts corrected for the size"),
    (_GSE, "G+SE 5 sigma", "gauss_se.threshold_sigma = 5", "a threshold of 5σ instead of 4σ"),
    (_GSE, "G+SE 12 arcsec", "gauss_se profile = paper", "a Gaussian of 12″ instead of 20″"),
    (_GSE, "G+SE 20 arcsec", "gauss_se profile = paper_clusters", "a Gaussian of 20″ instead of 12″"),
    (_GSE, "G+SE modern", "gauss_se profile = modern", "today's practice"),
    (_MR1, "MR/1+SE corrected", "mr1_se.aperture_correction = psf_table", "counts corrected for the aperture's loss"),
    (_MR1, "MR/1+SE first plane", "mr1_se.first_scale = 1", "the finest wavelet plane is used"),
)
_OPTION_CAMPAIGNS = {
    TEST_1: "test1_options",
    TEST_2: "test2_options",
    TEST_3: "test3_options",
    TEST_4: "test4_options",
    TEST_5: "test5_options",
}
OF_PROCEDURES = tuple(
    Option(name, about, ("test*", "cpu.*"), _OPTION_CAMPAIGNS, {label: changed}, (SOFT_10, SOFT_100))
    for label, changed, name, about in _SETTINGS
)
# Claims that name no procedure: ours is MR/1+SE's number.
OTHER_PROCEDURES = tuple(
    Option(f"procedure = {label}", f"the number of {label} instead of {_MR1}", ("test5.confusion.*", "test1.limit"),
           changes={"methods": (label,)})
    for label in LABELS.values()
    if label != _MR1
)  # fmt: skip
OPTIONS = (*OF_MATCHING, *OF_COUNTS, *OF_SKIES, *OF_PROCEDURES, *OTHER_PROCEDURES)


def option_views(statistic: Statistic) -> Iterator[tuple[Option, View]]:
    """The options that concern a statistic, with its view under each; its other readings first."""
    for reading in statistic.readings:
        option = Option(f"statistic = {reading.name}", reading.about, (statistic.claim,))
        yield option, replace(statistic.view, reading=reading.name)
    for option in OPTIONS:
        view = option.applied(statistic.claim, statistic.view)
        if view is not None:
            yield option, view
