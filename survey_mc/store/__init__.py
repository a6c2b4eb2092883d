"""What is kept of a run: whole Parquet files named by what made them, and a manifest that says which of them count."""

from survey_mc.store.damage import Damage
from survey_mc.store.layout import Family, Piece, RunLayout
from survey_mc.store.lock import run_lock
from survey_mc.store.manifest import Manifest, Record
from survey_mc.store.migrate import Migration, migrate_run
from survey_mc.store.parquet import commit_piece, write_frame
from survey_mc.store.run_data import CellRecord, MethodRecord, RunData
from survey_mc.store.stored_rows import read_piece, read_stored
from survey_mc.store.verify import verify_directory, verify_store

__all__ = [
    "CellRecord",
    "Damage",
    "Family",
    "Manifest",
    "MethodRecord",
    "Migration",
    "Piece",
    "Record",
    "RunData",
    "RunLayout",
    "commit_piece",
    "migrate_run",
    "read_piece",
    "read_stored",
    "run_lock",
    "verify_directory",
    "verify_store",
    "write_frame",
]
