"""What a drive says of model and car: identification, gap, agreement, side by side."""
