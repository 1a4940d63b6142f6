"""Are fits right, and are their error bars?

python experiments/identification/run.py              # all parts
python experiments/identification/run.py coverage     # one part, by the name of its module
"""

import sys

import baseline
import coverage
import other_code
import sampling
import separate

PARTS = {
    "coverage": coverage.main,
    "separate": separate.main,
    "sampling": sampling.main,
    "other_code": other_code.main,
    "baseline": baseline.main,
}


def main():
    for name in sys.argv[1:] or PARTS:
        print(f"-- {name}", flush=True)
        PARTS[name]()


if __name__ == "__main__":
    main()
