"""How the choices of the reproduction were made; shown on its page."""

CHOICES = (
    "No parameter was tuned on the fields of a test. What the paper states is taken as stated. What it leaves open was "
    "chosen on two campaigns with seeds of their own: blank_fields (what a procedure finds where there is nothing) and "
    "classification_training (simulated points and clusters for the stellarity network).",
    "Chosen on blank fields: the smallest area of G+SE (11 pixels, 16 for the 20″ Gaussian), which leaves at most one "
    "false detection inside 10′ of a 10 ks field (the number the paper prints for G+SE in Tabs. 4 and 5, which are "
    "thus no independent successes); the ring from which small wavelets of WAVDETECT and EWAVELET take "
    "their background; that VTPDETECT tests all counts of a group. Chosen from the documentation of the original "
    "programs: everything else that the paper does not print.",
    "Ours, because the paper shows them in figures only: the counts of the varying members of the pairs of Tests 1 and "
    "2, and the positions of the clusters of Test 4. The core radius is that of the paper's Tab. 2 (250 kpc), not of "
    "its text (250/h kpc); soft fluxes follow Hasinger et al. 1998, hard ones Giacconi et al. 2001.",
    "Where the paper can be read in more than one way, the other reading is an option campaign or another statistic of "
    "the same fields, and its effect stands in option_effects.csv. Options are not combined (but Giacconi's relation "
    "over the whole square is one option, and so is all that a procedure's profile changes), and no option makes a "
    "verdict: that is of the first reading. Some readings were added because the first one differed (false detections "
    "out to 15′, blends of Test 2 given to the clusters, positions half a pixel off, the 90 % limit as a limit of all "
    "brighter sources); as each cause is the best of about ten, one in a few is expected to fit by luck. Matching by "
    "the photons' origin and false detections that rest on no source are diagnoses: nobody could have done so in 2001.",
)
