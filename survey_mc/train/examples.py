"""Labelled detections of a finished run: what a network learns from and is judged by.

Idea     a detection whose photons come from one source alone (origin rule, no blend) is labelled by what that source
         is. Fields are dealt to training and validation whole: detections of one sky, seen with two exposures or by two
         procedures, are never on both sides.
Limits   false detections, blends and fragments of a source are left out: they are neither points nor extended.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey_mc.campaign import Campaign, Cell, expand
from survey_mc.campaign.draw import cell_response
from survey_mc.detect import DetectorParams
from survey_mc.detect.stellarity import INPUT_COLUMNS, N_INPUTS, has_stellarity, inputs_of_detections
from survey_mc.errors import BadInput
from survey_mc.store import RunData
from survey_mc.types import BoolArray, FloatArray

VALIDATION_EVERY = 5  # every fifth field
LABEL_COLUMNS = ["realisation", "rule", "status", "det_id", "is_blend", "kind_true"]


@dataclass(frozen=True, slots=True)
class Examples:
    """Detections with known origin. inputs: (n, 10); is_point: label; realisation: of the field; group: number of the
    (cell, method) each belongs to, named in `groups`."""

    inputs: FloatArray
    is_point: BoolArray
    realisation: NDArray[np.int32]
    group: NDArray[np.int32]
    groups: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.is_point)

    def where(self, chosen: BoolArray) -> Examples:
        """Those chosen."""
        return Examples(
            self.inputs[chosen], self.is_point[chosen], self.realisation[chosen], self.group[chosen], self.groups
        )

    def weights(self) -> FloatArray:
        """Weight of each example: groups weigh the same, and in each of them points as much as extended sources."""
        kind = 2 * self.group + self.is_point
        share = 1.0 / np.maximum(np.bincount(kind, minlength=2 * len(self.groups)), 1)
        weight = share[kind]
        return np.asarray(weight / weight.sum())


def refuse_without_stellarity(campaign: Campaign) -> None:
    """Raise `BadInput` for a campaign with a procedure that has no stellarity index."""
    for number, choice in enumerate(campaign.method):
        if not has_stellarity(choice.params):
            raise BadInput(campaign.name, f"method[{number}].name: {choice.name} has no stellarity index to train")


def gather_examples(campaign: Campaign, data: RunData) -> Examples:
    """All labelled detections of a run, ordered by cell, method, realisation and detection."""
    refuse_without_stellarity(campaign)
    inputs, labels, realisations, sizes, groups = [], [], [], [], []
    for cell in expand(campaign):
        for choice in campaign.method:
            found = _of_method(campaign, cell, choice.label, choice.params, data)
            inputs.append(found[0])
            labels.append(found[1])
            realisations.append(found[2])
            sizes.append(len(found[1]))
            groups.append(f"{choice.label}, {cell.label}")
    group = np.repeat(np.arange(len(groups), dtype=np.int32), sizes)
    return Examples(np.concatenate(inputs), np.concatenate(labels), np.concatenate(realisations), group, tuple(groups))


def _of_method(
    campaign: Campaign, cell: Cell, label: str, params: DetectorParams, data: RunData
) -> tuple[FloatArray, BoolArray, NDArray[np.int32]]:
    response = cell_response(campaign, cell)
    inputs, labels, realisations = [np.zeros((0, N_INPUTS))], [np.zeros(0, np.bool_)], [np.zeros(0, np.int32)]
    detections = data.frames("detections", cell.label, label, ["realisation", "det_id", *INPUT_COLUMNS])
    matches = data.frames("matches", cell.label, label, LABEL_COLUMNS)
    for found, matched in zip(detections, matches, strict=True):
        sure = matched[(matched["rule"] == "origin") & (matched["status"] == "matched") & ~matched["is_blend"]]
        joined = sure.merge(found, on=["realisation", "det_id"], how="left", validate="one_to_one")
        inputs.append(inputs_of_detections(joined, params, response.believed_psf, response.grid.scale_arcsec))
        labels.append((joined["kind_true"] == "point").to_numpy())
        realisations.append(joined["realisation"].to_numpy().astype(np.int32))
    return np.concatenate(inputs), np.concatenate(labels), np.concatenate(realisations)


def split_by_field(examples: Examples) -> tuple[Examples, Examples]:
    """Training and validation examples; every fifth field is for validation."""
    for_validation = examples.realisation % VALIDATION_EVERY == VALIDATION_EVERY - 1
    return examples.where(~for_validation), examples.where(for_validation)


def thinned(examples: Examples, most: int, rng: np.random.Generator) -> Examples:
    """At most `most` examples of each kind of each group, drawn without replacement, in their old order."""
    kind = 2 * examples.group + examples.is_point
    chosen = np.zeros(len(examples), np.bool_)
    for number in range(2 * len(examples.groups)):
        members = np.flatnonzero(kind == number)
        chosen[members if len(members) <= most else rng.choice(members, most, replace=False)] = True
    return examples.where(chosen)
