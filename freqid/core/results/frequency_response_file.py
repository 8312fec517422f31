"""Frequency responses on disk (``format="freqid-frequency-response"``)."""

from __future__ import annotations

from pathlib import Path

import h5py

from freqid.core import store
from freqid.core.results.frequency_response import FrequencyResponse

FORMAT = "freqid-frequency-response"
_ARRAYS = ("std_error", "degrees_of_freedom", "coherence", "partial_coherence", "misfit")


def write_frequency_response(path: Path, response: FrequencyResponse, scenario_sha256: str = "") -> None:
    """Write frequency responses, whole or not at all.

    Parameters
    ----------
    path : Path
    response : FrequencyResponse
    scenario_sha256 : str

    Raises
    ------
    DataError
        Where the folder cannot be written.
    """

    def fill(file: h5py.File) -> None:
        store.put(file, "frequency", response.frequencies_hz, "Hz")
        # units differ by output and input; they are in the attributes below
        store.put_complex(file, "value", response.value, "output unit / input unit")
        for name in _ARRAYS:
            unit = "output unit / input unit" if name == "std_error" else "1"
            store.put(file, name, getattr(response, name), unit)
        for name in ("inputs", "outputs", "input_units", "output_units", "remarks", "provenance"):
            store.put_json(file, name, getattr(response, name))
        file.attrs["method"] = response.method

    store.write(path, FORMAT, fill, scenario_sha256)


def read_frequency_response(path: Path) -> FrequencyResponse:
    """Read frequency responses.

    Raises
    ------
    DataError
        Where the file is no intact set of frequency responses.
    """
    with store.reading(path, FORMAT) as file:
        inputs, outputs, input_units, output_units, remarks = (
            tuple(store.get_json(file, n))
            for n in ("inputs", "outputs", "input_units", "output_units", "remarks")
        )
        frequencies = store.array(file, "frequency")
        value = store.complex_array(file, "value")
        expected = (len(outputs), len(inputs), frequencies.size)
        if value.shape != expected:
            raise ValueError(f"values have shape {value.shape}, expected {expected}")
        return FrequencyResponse(
            inputs,
            outputs,
            input_units,
            output_units,
            frequencies,
            value,
            *(store.array(file, name) for name in _ARRAYS),
            method=store.get_text(file, "method"),
            remarks=remarks,
            provenance=store.get_json(file, "provenance") or {},
        )
