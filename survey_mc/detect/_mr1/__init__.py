"""The MR/1 multiresolution filter."""
