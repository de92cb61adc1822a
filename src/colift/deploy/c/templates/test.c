// Compare the kernels with the answers of Python: the same in every bit, where neither compiler fuses or reorders.

#include "@HEADER@"
#include "colift_team.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_vectors.h"

#define WITHIN @WITHIN@ // of Python's answers; 0: every bit

static void copy(@REAL@ *to, const @REAL@ *from, int count)
{
    for (int k = 0; k < count; ++k) {
        to[k] = from[k];
    }
}

static int differs(const @REAL@ *found, const @REAL@ *wanted, int count)
{
    for (int k = 0; k < count; ++k) {
        const @REAL@ size = 1 + wanted[k] * wanted[k], gap = found[k] - wanted[k];
        const int same = memcmp(&found[k], &wanted[k], sizeof gap) == 0 || (isnan(found[k]) && isnan(wanted[k]));
        if (!same && !(gap < WITHIN * size && -gap < WITHIN * size)) {
            return 1;
        }
    }
    return 0;
}

static int told(const char *name, int wrong, int calls)
{
    printf("%-45s %d of %d calls as in Python\n", name, calls - wrong, calls);
    return wrong;
}

@PULLS@@TESTS@

int main(void)
{
    int wrong = 0;
@CALLS@
    return wrong == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
