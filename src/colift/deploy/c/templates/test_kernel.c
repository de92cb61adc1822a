static int test_@LAYER@(void)
{
    const int calls = (int)(sizeof(@LAYER@_calls) / sizeof(@LAYER@_calls[0]));
    int wrong = 0;
    for (int k = 0; k < calls; ++k) {
        const @REAL@ *at = @LAYER@_calls[k];
        const colift_now now = {(int)at[0], at[1], at[2]};
        at += 3;
        const colift_@LAYER@_sees sees = {COLIFT_DRONES@SEES@};
        at += @SEEN@;
        @REAL@ written[@WRITTEN@ + 1], memory[@MEMORY@ + 1];
        copy(written, at, @WRITTEN@);
        at += @WRITTEN@;
        copy(memory, at, @MEMORY@);
        at += @MEMORY@;
        const colift_@LAYER@_writes writes = {COLIFT_DRONES@WRITES@};
        int status = 0;
        @CALL@;
        if (status != (int)at[0] || @DIFFERS@) {
            ++wrong;
        }
    }
    return told("@NAME@", wrong, calls);
}
