"""Tables of directional albedo on their way to the device, made by `theory.bsdf` and read by `device.albedos`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import warp as wp

from fgf_warp.theory import bsdf as theory


class AlbedoTables:
    """Blocks of tables, one after the other in an array; each is there once. `device.albedos` tells their layout."""

    def __init__(self) -> None:
        whole, tip = theory.ggx_albedo()
        self._blocks = [whole.values, tip.values, whole.averages, tip.averages]
        self._count = sum(block.size for block in self._blocks)
        self._found: dict[tuple[str, float], int] = {}

    def add_dielectric(self, ior: float) -> int:
        """Adds the block of an opaque dielectric.

        Args:
            ior: its index of refraction, > 0.

        Returns:
            Where the block begins.
        """

        def blocks() -> list[np.ndarray]:
            (whole, tip), own = theory.ggx_albedo(), theory.dielectric_albedo(ior)
            products = [own.products(other) for other in (own, whole, tip)]
            return [own.values, own.averages, *products, np.array([theory.average_fresnel(ior)])]

        return self._add(("dielectric", ior), blocks)

    def add_glass(self, eta: float) -> int:
        """Adds the block of glass.

        Args:
            eta: index of refraction beyond the surface over that before it, > 0.

        Returns:
            Where the block begins; -1 for eta = 1, where nothing is refracted.
        """
        if eta == 1:
            return -1
        albedo = theory.glass_albedo(eta)
        return self._add(("glass", eta), lambda: [albedo.values, albedo.averages])

    def _add(self, key: tuple[str, float], blocks: Callable[[], list[np.ndarray]]) -> int:
        if key not in self._found:
            made = blocks()
            self._found[key] = self._count
            self._blocks += made
            self._count += sum(block.size for block in made)
        return self._found[key]

    def upload(self, device: str) -> wp.array:
        """The numbers of all blocks, (n,) float32."""
        values = np.concatenate([np.ravel(block) for block in self._blocks])
        return wp.array(values.astype(np.float32), dtype=float, device=device)
