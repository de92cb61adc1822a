static int test_cascade(void)
{
    static colift_cascade c;
    int wrong = 0;
    colift_cascade_start(&c);
    for (int step = 0; step < @STEPS@; ++step) {
        const double *at = cascade_steps[step];
@TAKE@
        colift_step(&c, step);
        if (differs(c.thrusts, at, COLIFT_DRONES) || differs(c.torques, at + COLIFT_DRONES, 3 * COLIFT_DRONES)) {
            ++wrong;
        }
    }
    return told("colift_step", wrong, @STEPS@);
}
