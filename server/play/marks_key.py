"""The key with which a participant asks for the marks, where a study shows them on demand only."""

from typing import Literal


class MarksKey:
    """One person's marks key.

    A frame shows the marks if the person asked for them when its state was made. `on_key`: the key was down at that
    moment, or was pressed since the state before, however short. `toggle`: each press turns them on or off.
    """

    def __init__(self, show: Literal["on_key", "toggle"], is_on: bool = False) -> None:
        """`is_on`: whether a toggle was on when this server took the episode up."""
        self._is_toggle = show == "toggle"
        self._is_on = is_on and self._is_toggle
        self._is_down = self._was_pressed = False

    def put(self, down: bool | None) -> bool:
        """Take in whether the key is down (None: no news). Return whether that changed."""
        if down is None or down == self._is_down:
            return False
        self._is_down = down
        if down:
            self._was_pressed = True
            self._is_on = self._is_toggle and not self._is_on
        return True

    def take(self) -> bool:
        """Return whether the person asks for the marks on the state that is made now."""
        was_pressed, self._was_pressed = self._was_pressed, False
        return self._is_on if self._is_toggle else self._is_down or was_pressed

    def release(self) -> None:
        """Release the key, because the game stands still or another page took over. A toggle stays as it is."""
        self._is_down = self._was_pressed = False
