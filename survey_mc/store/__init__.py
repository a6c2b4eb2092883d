"""What is kept of a run: whole Parquet files named by what made them, and a manifest that says which of them count."""

from survey_mc.store.layout import Family, Piece, RunLayout
from survey_mc.store.lock import run_lock
from survey_mc.store.manifest import Manifest, Record
from survey_mc.store.parquet import commit_piece, read_piece, write_frame
from survey_mc.store.run_data import CellRecord, MethodRecord, RunData
from survey_mc.store.verify import Damage, verify_store

__all__ = [
    "CellRecord",
    "Damage",
    "Family",
    "Manifest",
    "MethodRecord",
    "Piece",
    "Record",
    "RunData",
    "RunLayout",
    "commit_piece",
    "read_piece",
    "run_lock",
    "verify_store",
    "write_frame",
]
