"""Progress bars of the package tqdm, if it is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from lightoctree._types import Event


class Bars:
    """Shows the current stage of a job as a bar."""

    def __init__(self, tqdm: Callable[..., Any]) -> None:
        self._tqdm = tqdm
        self._bar: Any = None

    def __call__(self, event: Event) -> None:
        if event.kind == "begun":
            self.close()
            # Its name, until it reports steps.
            self._bar = self._tqdm(total=1, desc=event.stage, leave=False, bar_format="{desc}")
        elif event.kind == "progress" and self._bar is not None:
            self._bar.bar_format = None
            self._bar.total = event.total
            self._bar.update((event.done or 0) - self._bar.n)
        elif event.kind == "done":
            self.close()

    def close(self) -> None:
        """Removes the bar."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def bars() -> Bars | None:
    """Returns a handler that shows bars, or None where nobody would see them."""
    is_notebook = "ipykernel" in sys.modules
    if not (is_notebook or (sys.stderr is not None and sys.stderr.isatty())):
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return Bars(tqdm)
