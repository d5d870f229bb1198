"""``fantoccini cache``: describes or clears the cache folder."""

from __future__ import annotations

from fantoccini.app.cli_support import print_message, print_output, print_table
from fantoccini.kernel import build


def describe_cache(clear: bool, quiet: bool) -> None:
    """Prints the folder with numbers and sizes of its entries; removes them first, if asked.

    Args:
        clear: remove all entries.
        quiet: do not say what was removed.
    """
    before = build.contents()
    if clear:
        build.clear()
        if not quiet:
            size = sum(size for _, size in before.values())
            print_message(f"removed {size / 1e6:.1f} MB")
    print_output(build.cache_folder())
    print_table(
        "Contents",
        ("", "number>", "MB>"),
        [(kind, n, f"{size / 1e6:.1f}") for kind, (n, size) in build.contents().items()],
    )
