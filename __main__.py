"""``python -m aloft``: the same as the command ``aloft``."""

from .cli import main

if __name__ == "__main__":
    main()
