"""A procedure that crashes, hangs or eats all memory loses one field: limits, notes of what is tried, tries apart."""
