"""What a page holds beside the script that every page has."""

from __future__ import annotations

import re
from pathlib import Path

import freqid

SCRIPT = (Path(freqid.__file__).parent / "report/templates/page.js").read_text(encoding="utf-8")


def without_script(text: str) -> str:
    """Return a page without freqid's own script and the policy that admits it: what is left is from files."""
    assert text.count(SCRIPT) == 1
    text = text.replace(f"<script>\n{SCRIPT}\n</script>", "")
    return re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", text, count=1)
