#!/bin/sh
# mypy over the whole package. The checkout is the package, so in a folder of another name it is seen
# through a link: mypy then knows every module by the name that others import.
set -e
if [ "$(basename "$PWD")" = aloft ]; then
    exec .venv/bin/mypy .
fi
mkdir -p .mypy_cache/checkout
ln -sfn ../.. .mypy_cache/checkout/aloft
exec .venv/bin/mypy .mypy_cache/checkout/aloft
