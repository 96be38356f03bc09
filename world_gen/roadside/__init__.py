"""What stands beside roads and is no building: trees, lamps, posts, walls, rails, shelters."""
