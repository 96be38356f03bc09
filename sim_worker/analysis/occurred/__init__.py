"""What really occurred in a drive: scenarios recognised, and what they mean to safety."""
