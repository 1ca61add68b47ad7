"""Models with the recorded sizes: the catalogue that the test cases of a recording use."""

from __future__ import annotations

from foresee_dsl.language import model as m
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import bundled_models
from foresee_recordings.recording import Track

_LEAST_M = 0.3
"""Smallest length and width of a model, m. Ours: a person's."""


class Models:
    """The models of a recording's actors, by size in steps of 0.1 m: `car.r45x18` is 4.5 m long and 1.8 m wide."""

    def __init__(self) -> None:
        self._models: dict[str, m.VehicleModel] = {}

    def of(self, track: Track) -> str:
        """Return the name of the model with an actor's class and size."""
        length, width = (max(round(side, 1), _LEAST_M) for side in (track.length_m, track.width_m))
        name = f"{track.kind}.r{round(length * 10):02d}x{round(width * 10):02d}"
        if name not in self._models:
            self._models[name] = _sized(nearest(track.kind, length, width), name, length, width)
        return name

    def text(self, name: str) -> str:
        """Return the file of a catalogue of this name."""
        body = tuple(self._models[model] for model in sorted(self._models))
        doc = m.Doc(text="Sizes as recorded, rounded to 0.1 m; the other values as in the nearest bundled model.")
        return print_model(m.Catalogue(name=name, body=(doc, *body)))


def nearest(kind: str, length_m: float, width_m: float) -> m.VehicleModel:
    """Return the bundled model of a class whose length and width differ the least."""

    def apart(model: m.VehicleModel) -> float:
        sizes = [side.si if isinstance(side, m.Quantity) else 0.0 for side in (model.length, model.width)]
        return abs(sizes[0] - length_m) + abs(sizes[1] - width_m)

    return min((model for name, model in bundled_models().items() if name.partition(".")[0] == kind), key=apart)


def _sized(like: m.VehicleModel, name: str, length_m: float, width_m: float) -> m.VehicleModel:
    """Return a model of another size; wheelbase and front overhang keep their shares of the length."""
    changes: dict[str, object] = {
        "name": name,
        "length": _metres(length_m, 1),
        "width": _metres(width_m, 1),
        "rear_overhang": None,
        "source": f"size as recorded, the rest of {like.name}",
    }
    if isinstance(like.length, m.Quantity):
        for field in ("wheelbase", "front_overhang"):
            value = getattr(like, field)
            if isinstance(value, m.Quantity):
                changes[field] = _metres(value.si * length_m / like.length.si, 2)
    return like.model_copy(update=changes)


def _metres(value: float, digits: int) -> m.Quantity:
    return m.Quantity.of(value, "length", digits)
