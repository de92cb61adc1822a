"""The random numbers are Philox's, and do what it promises: along numbers, channels, keys and bits."""

from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from colift.flight.flight import random_key
from colift.kernel.math import noise

KEY = random_key(0, "sensing")
SAMPLES = 2**26
"""Cells that correlations are taken over: one of 1e-3 stands out by 8 standard deviations (2^31: one of 2e-4)."""


# Random123 1.14, tests/kat_vectors, "philox4x32 10": counter, key, answer.
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]  # fmt: skip


def words(text):
    return [int(word, 16) for word in text.split()]


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_philox_gives_the_published_answers_compiled_or_not(counter, key, answer):
    plain = getattr(noise.philox, "py_func", noise.philox)
    for function in (noise.philox, plain):
        assert list(function(*words(key), *words(counter))) == words(answer)


def test_cells_are_philox_blocks_and_uniforms_have_53_bits():
    """Counter: channel, then number, low word first; key: low word first; of any sign."""
    for key, number, channel in [(KEY, 7, 3), (-5, -1, 2), (2**62 + 9, 2**40 + 1, 2**33 + 4)]:
        low_first = [(x >> shift) & 0xFFFFFFFF for x in (key, channel, number) for shift in (0, 32)]
        a, b, c, d = noise.philox(*low_first)
        found = noise.uniforms(key, number, channel)
        assert found == (((a << 32 | b) >> 11) / 2**53, ((c << 32 | d) >> 11) / 2**53)
        assert found[0] == noise.uniform(key, number, channel)
        u, v = found
        radius = math.sqrt(-2.0 * math.log(1.0 - u))
        wanted = (radius * math.cos(2.0 * math.pi * v), radius * math.sin(2.0 * math.pi * v))
        assert noise.normals(key, number, channel) == pytest.approx(wanted, rel=1e-14)
        assert noise.normal(key, number, channel) == noise.normals(key, number, channel)[0]


def test_keys_use_all_64_bits():
    keys = [random_key(seed, name) for seed in range(2000) for name in ("sensing", "link")]
    assert len(set(keys)) == len(keys)
    for bit in range(64):
        share = np.mean([(key >> bit) & 1 for key in keys])
        assert abs(share - 0.5) < 4.5 * 0.5 / np.sqrt(len(keys))


@numba.njit
def _flips(key, trials, counts):
    """How often each of the 128 bits of a block changes when one bit of key, number or channel does."""
    for trial in range(trials):
        number, channel = trial * 977, trial * 31
        before = noise.philox(
            key & 0xFFFFFFFF, (key >> 32) & 0xFFFFFFFF, channel, 0, number, number >> 32
        )
        for m in range(192):
            bit = 1 << (m % 32)
            x = [bit if m // 32 == k else 0 for k in range(6)]
            after = noise.philox(
                (key & 0xFFFFFFFF) ^ x[0], ((key >> 32) & 0xFFFFFFFF) ^ x[1], channel ^ x[2], x[3],
                number ^ x[4], (number >> 32) ^ x[5],
            )  # fmt: skip
            for w in range(4):
                changed = before[w] ^ after[w]
                for b in range(32):
                    counts[m, 32 * w + b] += (changed >> b) & 1


def test_every_bit_of_key_number_and_channel_moves_every_bit_of_the_block_half_the_time():
    trials, counts = 4000, np.zeros((192, 128), np.int64)
    _flips(KEY, trials, counts)
    z = (counts - 0.5 * trials) / (0.5 * np.sqrt(trials))
    assert np.abs(z).max() < 6.0  # of 24 576; expected 4.3
    assert z.std() == pytest.approx(1.0, abs=0.03)


@numba.njit(fastmath={"reassoc", "contract"})
def _products(key, next_key, channels, samples, sums):
    """Sums of products of centred uniforms: pair, next channel, next number, next key, channel and number."""
    past = np.zeros((channels, 2))
    for number in range(samples // channels):
        before = np.zeros(2)
        corner = np.zeros(2)
        for channel in range(channels):
            u, v = noise.uniforms(key, number, channel)
            r, s = noise.uniforms(next_key, number, channel)
            u, v, r, s = u - 0.5, v - 0.5, r - 0.5, s - 0.5
            old = past[channel]
            sums[0] += u * v
            sums[1] += u * before[0]
            sums[2] += v * before[1]
            sums[3] += v * before[0]
            sums[4] += u * before[1]
            sums[5] += u * old[0]
            sums[6] += v * old[1]
            sums[7] += u * old[1]
            sums[8] += v * old[0]
            sums[9] += u * r
            sums[10] += v * s
            sums[11] += u * s
            sums[12] += v * r
            sums[13] += u * corner[0]
            sums[14] += v * corner[1]
            corner[0], corner[1] = old[0], old[1]
            old[0], old[1] = u, v
            before[0], before[1] = u, v


@pytest.mark.parametrize(
    "keys", [(0, 1), (KEY, KEY ^ 1 << 40)], ids=["keys 0 and 1", "one high bit apart"]
)
def test_neighbours_in_pair_channel_number_and_key_are_uncorrelated(keys):
    sums = np.zeros(15)
    _products(*keys, 64, SAMPLES, sums)
    correlation = 12.0 * sums / SAMPLES
    assert np.abs(correlation).max() < 4.5 / np.sqrt(SAMPLES)


@numba.njit
def _histogram(key, samples, scale, counts):
    for number in range(samples):
        for u in noise.uniforms(key, number, 3):
            counts[int((u * scale) % 1.0 * counts.size)] += 1


@pytest.mark.parametrize("bits", [0, 20, 43], ids=["high bits", "middle bits", "lowest bits"])
def test_uniforms_are_even_in_all_their_bits(bits):
    counts = np.zeros(1024, np.int64)
    _histogram(KEY, 2_000_000, 2.0**bits, counts)
    expected = counts.sum() / counts.size
    chi = np.sum((counts - expected) ** 2 / expected)  # 1023 degrees of freedom
    assert abs(chi - 1023.0) < 4.0 * np.sqrt(2.0 * 1023.0)


@numba.njit
def _draw(key, numbers, channels, out):
    for number in range(numbers):
        for channel in range(channels):
            out[number, channel, 0], out[number, channel, 1] = noise.normals(key, number, channel)


@pytest.fixture(scope="module")
def normals():
    out = np.zeros((200_000, 50, 2))
    _draw(KEY, 200_000, 50, out)
    return out


def test_no_number_comes_twice(normals):
    """Of 2^53; with only 2^32 values, 10 million draws would hold some 11 600 twins."""
    assert len(np.unique(normals[..., 0])) == normals[..., 0].size


def test_normals_have_the_moments_of_a_normal(normals):
    n = normals.size
    assert abs(normals.mean()) < 4.0 / np.sqrt(n)
    assert abs(normals.var() - 1.0) < 4.0 * np.sqrt(2.0 / n)
    assert abs((normals**3).mean()) < 4.0 * np.sqrt(15.0 / n)
    assert abs((normals**4).mean() - 3.0) < 4.0 * np.sqrt(96.0 / n)


def test_normals_have_the_tails_of_a_normal(normals):
    """Counts beyond 1 to 5 standard deviations on either side."""
    for bound in (1.0, 2.0, 3.0, 4.0, 4.5, 5.0):
        wanted = normals.size * 0.5 * math.erfc(bound / math.sqrt(2.0))
        for side in (normals, -normals):
            assert abs(np.count_nonzero(side > bound) - wanted) < 4.5 * math.sqrt(wanted)


def test_squares_of_neighbours_are_uncorrelated(normals):
    """The two of a cell share their radius: independent only if that is right."""
    z = (normals[:50_000] ** 2 - 1.0) / math.sqrt(2.0)
    pairs = {
        "cell": (z[..., 0], z[..., 1]),
        "channel": (z[:, 1:], z[:, :-1]),
        "number": (z[1:], z[:-1]),
    }
    for name, (a, b) in pairs.items():
        assert abs((a * b).mean()) < 4.5 / np.sqrt(a.size), name


def test_ticks_count_the_same_time_at_any_physics_step():
    ticks = {
        dt: [noise.tick(step, dt) for step in range(round(3.0 / dt) + 1)]
        for dt in (2e-3, 1e-3, 5e-4, 1e-4, 1e-5)
    }
    assert ticks[1e-3] == list(range(3001))
    for dt, found in ticks.items():
        per_tick = max(1, round(1e-3 / dt))
        assert found[::per_tick] == ticks[1e-3][:: max(1, round(dt / 1e-3))]
        assert found[per_tick - 1] == 0
    assert noise.tick(10**12, 0.01) == 10**13


def test_the_circle_is_one():
    """Of shares that lie close to the ends of quarters and eighths too."""
    near = np.nextafter(np.arange(8) / 8.0, 1.0)
    shares = np.concatenate(
        [
            np.arange(8) / 8.0,
            near,
            np.nextafter(near[1:], 0.0),
            np.random.default_rng(3).random(4000),
        ]
    )
    found = np.array([noise.on_circle(share) for share in shares.tolist()])
    np.testing.assert_allclose(found[:, 0], np.cos(2.0 * np.pi * shares), rtol=0, atol=8e-16)
    np.testing.assert_allclose(found[:, 1], np.sin(2.0 * np.pi * shares), rtol=0, atol=8e-16)
