"""From what sensors of many zones send to images: VL53L5CX and L8CX, depth cameras, planar scanners."""
