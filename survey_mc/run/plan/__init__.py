"""What a campaign will cost, and how its work is cut."""
