/* Times a step of the model, one of the observer, and one of two nodes as written by hand: prints
 * nanoseconds of each, and the size of the observer's state in bytes. */
#include <stdio.h>
#include <time.h>

#include "thermal_network.h"

#define NUM 500000L

/* Two nodes by Euler's method, as it is often written. */
static void by_hand(double T[2], double current_A, double losses_W, double sink_degC)
{
    const double copper_W = 0.02*current_A*current_A*(1.0 + 0.00393*(T[0] - 20.0));
    const double across_W = (T[0] - T[1])/0.1;
    const double out_W = (T[1] - sink_degC)/0.12;
    T[0] += HEATRUN_STEP_S*(copper_W - across_W)/700.0;
    T[1] += HEATRUN_STEP_S*(losses_W - copper_W + across_W - out_W)/12000.0;
}

static double ns_since(clock_t begun)
{
    return 1e9*(double)(clock() - begun)/CLOCKS_PER_SEC/(double)NUM;
}

int main(void)
{
    heatrun_real start[HEATRUN_NUM_NODES];
    heatrun_inputs inputs = {0};
    heatrun_state state;
    heatrun_observer observer;
    volatile double seen = 0.0;
    double T[2] = {40.0, 40.0}, model_ns, observer_ns, hand_ns;
    clock_t begun;
    long i;
    for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
        start[i] = (heatrun_real)40.0;
    }
    inputs.current_A = (heatrun_real)(0.05*HEATRUN_MAX_CURRENT_A);
    inputs.losses_W = (heatrun_real)(0.05*HEATRUN_MAX_LOSSES_W);
    inputs.sink_degC = (heatrun_real)25.0;
#if HEATRUN_HAS_SPEED
    inputs.speed_rpm = (heatrun_real)(0.4*HEATRUN_MAX_SPEED_RPM);
#endif
#if HEATRUN_HAS_COOLANT
    inputs.coolant_degC = (heatrun_real)25.0;
#endif
    if (heatrun_start(&state, start) != HEATRUN_OK
        || heatrun_observer_start(&observer, start, (heatrun_real)5.0) != HEATRUN_OK) {
        return 1;
    }
    begun = clock();
    for (i = 0; i < NUM; ++i) {
        by_hand(T, (double)inputs.current_A, (double)inputs.losses_W, 25.0);
        seen = T[0];
    }
    hand_ns = ns_since(begun);
    begun = clock();
    for (i = 0; i < NUM; ++i) {
        if (heatrun_step(&state, &inputs) != HEATRUN_OK) {
            return 1;
        }
    }
    model_ns = ns_since(begun);
    begun = clock();
    for (i = 0; i < NUM; ++i) {
        const heatrun_real reading = (heatrun_real)40.0 + (heatrun_real)0.01*(heatrun_real)(i % 7);
        seen = (double)heatrun_observer_step(&observer, &inputs, reading).sd_K[0];
    }
    observer_ns = ns_since(begun);
    printf("%.1f %.1f %.1f %lu\n", hand_ns, model_ns, observer_ns,
           (unsigned long)sizeof observer);
    return seen > 0.0 ? 0 : 1;
}
