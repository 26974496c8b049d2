"""Several prototypes on one manoeuvre in one view: virtual, semi-real, real, and repeats."""
