// A sine, a cosine and an arc cosine that every machine rounds in the same way; none of them is accurate.

#ifndef ONE_SINE_H
#define ONE_SINE_H

#include <math.h>

static inline double one_sine(double x)
{
    const double turns = rint(x / 3.141592653589793);
    const double y = x - turns * 3.141592653589793;
    const double z = y * y;
    const double sine = y * (1 - z / 6 * (1 - z / 20 * (1 - z / 42 * (1 - z / 72 * (1 - z / 110)))));
    return ((long)turns & 1) != 0 ? -sine : sine;
}

static inline double one_cosine(double x)
{
    return one_sine(x + 1.5707963267948966);
}

static inline double one_arc_cosine(double c)
{
    return sqrt(2 - 2 * c) * (1 + (2 - 2 * c) / 24);
}

#define sin one_sine
#define cos one_cosine
#define acos one_arc_cosine

#endif
