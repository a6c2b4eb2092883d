"""What the words of a report mean: shown on its page, one paragraph a word."""

DEFINITIONS = (
    (
        "input list, region",
        "The true sources with at least the stated number of counts (expected, vignetted, unless the campaign says "
        "on axis). Matching uses the whole image; tables use what lies inside the region around the optical axis.",
    ),
    (
        "matched, nearest rule",
        "A detection takes the nearest source of the input list within the radius. Of several detections on one "
        "source the closest keeps it. A chance neighbour counts as a match; a blend whose centroid is off both "
        "sources does not.",
    ),
    (
        "matched, origin rule",
        "A detection belongs to the source whose photons peak there: the largest excess inside its aperture over a "
        "ring of equal area, or the most photons where no excess is above its noise. They must stand out of the "
        "background. Of several detections on one source the one with most of its photons keeps it. No search radius "
        "is involved.",
    ),
    (
        "missed",
        "A source of the input list, inside the region, that is matched to no detection. Matched and missed "
        "sources together are all of them.",
    ),
    (
        "completeness",
        "Matched over all sources of the input list, in bins of an input quantity: true flux or expected counts, "
        "never measured ones. Because the list is cut in counts, the faintest flux bins hold only the less "
        "vignetted sources.",
    ),
    (
        "90 % limit",
        "The completeness is made non-decreasing by isotonic regression, weighted with the number of sources, and "
        "interpolated linearly in the logarithm between the mean positions of the bins. Its interval holds 68 % of "
        "the limits found from resampled fields.",
    ),
    (
        "false",
        "A detection inside the region without a counterpart in the input list: spurious, blend or faint. This is "
        "what the paper calls a false detection.",
    ),
    (
        "spurious, blend, faint, duplicate",
        "Spurious: nothing real is there, or nothing near enough. Blend: two or more sources gave the photons and "
        "none of them is the detection's own. Faint: a true source below the count limit. Duplicate: another "
        "detection has the source; it is counted beside the false ones, not among them.",
    ),
    (
        "purity",
        "Matched over all detections in the region, duplicates among them. Density of false detections: per field and "
        "per deg² of the region, each kind apart.",
    ),
    (
        "chance matches, corrected completeness",
        "The detections are turned about the optical axis; what still falls on a source of the list does so by chance. "
        "A lost source can be taken only by a detection that has no source, so the unmatched detections, turned, give "
        "the chance p of a lost source and the corrected completeness (C − p)/(1 − p). The table chance_matches also "
        "has the turned catalogue of all detections and the closed form 1 − exp(−π r² n).",
    ),
    (
        "true class, called extended",
        "The true class of a detection is the kind of its source by the rule (matched, duplicate or faint), or blend, "
        "or spurious. It is called extended if the statistic of its procedure is beyond the usual cut, and point if "
        "the statistic is not known. The paper's joint cut: stellarity < 0.1, r50 ≥ 20″, more than 20 detected counts, "
        "inside 10′.",
    ),
    (
        "completeness, contamination, area under the curve",
        "Of a classification: extended detections called extended over all extended detections; detections called "
        "extended that are not over all called extended; and the chance that an extended detection looks more extended "
        "than a point. Only the last does not depend on how many sources of each kind the sky has.",
    ),
    (
        "counts, fluxes",
        "Counts on axis are rate times exposure, un-vignetted (the paper's input counts); expected counts are "
        "vignetted. A ratio of measured to true values is named by its denominator; counts / counts_onaxis is the "
        "paper's SCTS(out)/SCTS(in), which lies below 1 off axis. It is for matched sources, so near the limit it "
        "favours upward fluctuations. Medians are given beside the paper's means, which a few blends can move far.",
    ),
    (
        "position error",
        "The radius that holds 68.27 % of the matched detections around their sources. In the first table for "
        "sources of more than 50 counts on axis; an asterisk marks rows without any, where all matched sources are "
        "used.",
    ),
    (
        "intervals",
        "68.27 % unless another number is given. Fractions: Jeffreys, closed at 0 and 1, and beside it the interval "
        "from resampled fields (…_fields), because sources of one field are not independent; the design effect is the "
        "ratio of the two variances. For claims such as “at least 90 % complete” the Clopper–Pearson interval of 95 % "
        "(…_cp), which never covers less than it says. Numbers: exact Poisson (Garwood). Medians: binomial ranks. "
        "Limits: resampled fields.",
    ),
)
