#!/bin/sh
# mypy over the whole package. The checkout is the package, and mypy refuses a package in a folder
# whose name is no Python name (aloft-1.0), so such a checkout is seen through a link that has one.
set -e
case $(basename "$PWD") in
    [0-9]* | *[!A-Za-z0-9_]*)
        mkdir -p .mypy_cache/checkout
        ln -sfn ../.. .mypy_cache/checkout/aloft
        exec .venv/bin/mypy .mypy_cache/checkout/aloft
        ;;
    *) exec .venv/bin/mypy . ;;
esac
