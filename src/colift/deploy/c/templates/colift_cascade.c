#include "@NAME@.h"

#include <math.h>

void @NAME@_start(@NAME@ *c)
{
    static const @NAME@ nothing;
    *c = nothing;
@START@
}

void @FUNCTION@(@NAME@ *c, int step)
{
    const @REAL@ time = (@REAL@)step * @PERIOD@_STEP;
@IF ENDS@
    for (int i = 0; i < COLIFT_DRONES; ++i) { // all cables end where the load is
        for (int k = 0; k < 2 * 3; ++k) {
            c->estimated_ends[6 * i + k] = c->estimated_load[k];
        }
    }
@END ENDS@
@IF CLOCK@
@COURSE@
    // From derivatives along the reference's clock to those in time; shifted.
    const @REAL@ r = c->clock[1], r1 = c->clock_bends[0], r2 = c->clock_bends[1];
    for (int j = 0; j < 3; ++j) {
        const @REAL@ *x = c->course_reference + j, *shift = c->reference_shift + j;
        @REAL@ *wanted = c->reference + j;
        wanted[0] = x[0] + shift[0];
        wanted[3] = r * x[3] + shift[3];
        wanted[6] = r * r * x[6] + r1 * x[3] + shift[6];
        wanted[9] = r * r * r * x[9] + 3 * r * r1 * x[6] + r2 * x[3] + shift[9];
    }
    for (int i = 0; i < COLIFT_DRONES; ++i) {
        for (int j = 0; j < 3; ++j) {
            const @REAL@ *w = c->course_nominal_forces + 9 * i + j;
            @REAL@ *wanted = c->nominal_forces + 9 * i + j;
            wanted[0] = w[0];
            wanted[3] = r * w[3];
            wanted[6] = r * r * w[6] + r1 * w[3];
        }
    }
@END CLOCK@
@IF ENDS@
    for (int i = 0; i < COLIFT_DRONES; ++i) {
        for (int k = 0; k < 4 * 3; ++k) {
            c->wanted_ends[12 * i + k] = c->reference[k];
        }
    }
@CALLS@
    for (int i = 0; i < COLIFT_DRONES; ++i) { // heard at once
        c->received_tensions[i] = c->lift_share[0] * c->desired_tensions[i];
        for (int k = 0; k < 3; ++k) {
            c->received_directions[3 * i + k] = c->desired_directions[3 * i + k];
        }
    }
@END ENDS@
@MORE@
}
