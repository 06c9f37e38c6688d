"""Warp functions and structs of the renderer, float32 and branch-light; no launches here."""
