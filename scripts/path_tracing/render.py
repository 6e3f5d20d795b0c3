"""Estimates of a scene's picture, part by part, with their variances."""

import itertools
import time

import drjit as dr
import mitsuba as mi
import numpy as np

# Samples of one pass: enough to keep the cores busy, few enough for a laptop's memory.
LANES = 1 << 20

# Russian roulette starts after that many bounces. Nothing else ends a path but darkness and the void.
ROULETTE_DEPTH = 5


# Hidden surfaces before one another that a camera looks through.
HIDDEN = 4


class Part:
    """A sum of samples for some of the pixels, all of one kind."""

    numbers = itertools.count()

    def __init__(self, name, pixels, size):
        self.name = name
        self.pixels = pixels
        self.sum = np.zeros((size, 3))
        self.squares = np.zeros((size, 3))
        self.count = 0  # independent samples in the sums
        self.passes = 0
        self.seconds = 0.0
        self.first_seed = next(Part.numbers) << 24

    def seed(self):
        """A new one for each pass of each part."""
        return self.first_seed + self.passes

    def go_on(self):
        start = time.perf_counter()
        self.render()
        self.passes += 1
        self.seconds += time.perf_counter() - start

    def mean(self):
        return self.sum / self.count

    def variance_of_mean(self):
        return np.maximum(self.squares / self.count - self.mean() ** 2, 0) / max(self.count - 1, 1)


class Paths(Part):
    """Path tracing, all samples of a pass as neighbouring array elements.

    With `without`, the scene whose mirrors and glass are black, primary rays that meet a matte surface go on there:
    the rest of what they would find is `Caustics`.
    """

    def __init__(self, name, scene, pixels, spp, without=None, has_media=False):
        super().__init__(name, pixels, np.prod(scene.sensors()[0].film().size()))
        self.scene = scene
        self.without = without
        kind = "volpathmis" if has_media else "path"
        self.integrator = mi.load_dict({"type": kind, "max_depth": -1, "rr_depth": ROULETTE_DEPTH})
        # Two passes are the least.
        self.samples = int(np.clip(LANES // max(len(pixels), 1), 1, np.ceil(spp / 2)))

    def spp(self):
        return self.count

    def render(self):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(self.seed(), self.samples * len(self.pixels))
        ray = primary_rays(self.scene, self.pixels, self.samples, sampler.next_2d())
        if self.without:
            is_specular = meets_specular(self.scene, ray)
            some, _, _ = self.integrator.sample(self.scene, sampler, ray, active=is_specular)
            others, _, _ = self.integrator.sample(self.without, sampler, ray, active=~is_specular)
            radiance = dr.select(is_specular, some, others)
        else:
            radiance, _, _ = self.integrator.sample(self.scene, sampler, ray)
        wide = [mi.Float64(channel) for channel in radiance]
        sums = [dr.block_sum(channel, self.samples) for channel in wide]
        squares = [dr.block_sum(channel * channel, self.samples) for channel in wide]
        dr.eval(sums, squares)
        self.sum[self.pixels] += np.stack([channel.numpy() for channel in sums], axis=1)
        self.squares[self.pixels] += np.stack([channel.numpy() for channel in squares], axis=1)
        self.count += self.samples


class Caustics(Part):
    """What mirrors and glass add to the light on matte surfaces that are seen directly, by light tracing: the picture with
    them less the picture with black ones. Both from the same random numbers, so that all paths cancel that meet none.
    (Light tracing can't find what the camera sees in mirrors or through glass; so both pictures lack that.)"""

    def __init__(self, scene, without, pixels):
        super().__init__("caustics", pixels, len(pixels))
        self.scenes = scene, without
        self.integrator = mi.load_dict({"type": "ptracer", "max_depth": -1, "rr_depth": ROULETTE_DEPTH})
        self.samples = max(1, LANES // len(pixels))

    def spp(self):
        return self.count * self.samples

    def render(self):
        pictures = [
            np.array(mi.render(scene, integrator=self.integrator, seed=self.seed(), spp=self.samples), float)
            for scene in self.scenes
        ]
        difference = (pictures[0] - pictures[1]).reshape(-1, 3)
        self.sum += difference
        self.squares += difference**2
        self.count += 1


def primary_rays(scene, pixels, samples, offsets):
    """`samples` neighbouring rays for each pixel, through `offsets` from 0 to 1 within it."""
    sensor = scene.sensors()[0]
    width, height = sensor.film().size()
    index = dr.arange(mi.UInt32, samples * len(pixels))
    pixel = dr.gather(mi.UInt32, mi.UInt32(pixels.astype(np.uint32)), index // samples)
    corner = mi.Point2f(pixel % width, pixel // width)
    position = (corner + offsets) / mi.Point2f(width, height)
    ray, _ = sensor.sample_ray_differential(0, 0, position, mi.Point2f(0.5))
    # As in ppm-vk, cameras look through the backs of surfaces with one side; light doesn't.
    for _ in range(HIDDEN):
        si = scene.ray_intersect(mi.Ray3f(ray))
        is_back = si.is_valid() & (dr.dot(ray.d, si.n) > 0)
        is_hidden = is_back & (si.shape.eval_attribute_1("vertex_hidden", si, is_back) > 0.5)
        ray.o = dr.select(is_hidden, si.spawn_ray(ray.d).o, ray.o)
    return ray


def meets_specular(scene, ray):
    si = scene.ray_intersect(ray)
    return si.is_valid() & mi.has_flag(si.bsdf().flags(), mi.BSDFFlags.Delta)


def by_noise(scene, pixels, without):
    """The pixels in groups of similar noise, most first, each twice as large as the one before. A few pixels have nearly all
    the noise where mirrors or glass show caustics.

    The samples that tell are thrown away: how many more a pixel gets must not depend on those that count.
    """
    pilot = Paths("pilot", scene, pixels, 512, without)
    while pilot.spp() < 256:
        pilot.go_on()
    mean = pilot.mean()
    noise = (pilot.variance_of_mean() / (mean**2 + 0.01 * mean.mean() ** 2)).mean(axis=1)
    # Neighbours are alike, and a pixel's own samples too few.
    width, height = scene.sensors()[0].film().size()
    padded = np.pad(noise.reshape(height, width), 2)
    noise = sum(padded[y : y + height, x : x + width] for y in range(5) for x in range(5)).ravel()
    ends = [len(pixels) >> halvings for halvings in range(8, 0, -1)]
    return np.split(np.argsort(-noise), ends)


class Estimate:
    """The picture as the sum of its parts."""

    def __init__(self, parts):
        self.parts = [part for part in parts if len(part.pixels)]

    def mean(self):
        return sum(part.mean() for part in self.parts)

    def error(self, part=None):
        """Relative standard error of the picture, or what the part contributes to it: the root of the mean over pixels
        and channels of var / (mean² + 0.01 m²), m the mean of the whole picture."""
        mean = self.mean()
        variance = sum(part.variance_of_mean() for part in ([part] if part else self.parts))
        return np.sqrt(np.mean(variance / (mean**2 + 0.01 * mean.mean() ** 2)))

    def error_of_whole(self):
        """Relative standard errors of the mean of all pixels, for each channel. Pixels are independent."""
        variance = sum(part.variance_of_mean() for part in self.parts)
        return np.sqrt(variance.sum(axis=0)) / self.mean().sum(axis=0)

    def go_on(self, spp, seconds):
        """One more pass of the part where the time lowers the error most; False when there is nothing left to do."""
        # The variance between two passes at least is needed to judge.
        young = [part for part in self.parts if part.passes < 2]
        left = [part for part in self.parts if part.spp() < spp]
        if young:
            young[0].go_on()
        elif left and sum(part.seconds for part in self.parts) < seconds:
            # A part with variance V after the time t lowers it by V / t in the next second.
            max(left, key=lambda part: self.error(part) ** 2 / part.seconds).go_on()
        else:
            return False
        return True

    def has_error(self):
        return all(part.passes >= 2 for part in self.parts)
