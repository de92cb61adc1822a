// Compare the kernels with the answers of Python: the same in every bit, where neither compiler fuses or reorders.

#include "colift.h"
#include "colift_team.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_vectors.h"

static void copy(@REAL@ *to, const @REAL@ *from, int count)
{
    for (int k = 0; k < count; ++k) {
        to[k] = from[k];
    }
}

static int differs(const @REAL@ *found, const @REAL@ *wanted, int count)
{
    for (int k = 0; k < count; ++k) {
        if (memcmp(&found[k], &wanted[k], sizeof found[k]) != 0 && !(isnan(found[k]) && isnan(wanted[k]))) {
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

@TESTS@

int main(void)
{
    int wrong = 0;
@CALLS@
    return wrong == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
