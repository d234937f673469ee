import numpy as np
import pytest
from scipy import fft

from closedrooms.predictor.structure import fourier


@pytest.mark.parametrize("size", [64, 90, 308])
def test_the_transform_is_scipys_own(size):
    picture = (np.random.default_rng(size).random((size, size)) < 0.1).astype(np.float32)
    spectrum = fourier.transform(picture)
    assert spectrum.dtype == np.complex64
    assert np.array_equal(spectrum, fft.fft2(picture))
    back = fft.ifft2(spectrum.copy())
    assert np.array_equal(fourier.transform_back(spectrum), back)
    np.testing.assert_allclose(back.real, picture, atol=1e-5)


def test_sizes_are_scipys_own():
    assert [fourier.quick_size(n) for n in range(1, 2000)] == [fft.next_fast_len(n, real=False) for n in range(1, 2000)]


def test_where_the_compiled_file_is_not_found_the_package_does_the_same(monkeypatch):
    fourier._pocketfft.cache_clear()
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    assert fourier.quick_size(61) == 63
    fourier._pocketfft.cache_clear()


def test_the_compiled_file_is_loaded_without_its_package(monkeypatch):
    def refuse(name):
        raise AssertionError(f"{name} is imported")

    fourier._pocketfft.cache_clear()
    monkeypatch.setattr(fourier.importlib, "import_module", refuse)
    assert fourier.quick_size(61) == 63
    fourier._pocketfft.cache_clear()
