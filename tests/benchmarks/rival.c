/* The same third-order step of the two-node network, walkers in the inner loop.
 * Build: cc -O3 -march=native -shared -fPIC. Used by run.py through ctypes. */
#include <stddef.h>

/* theta: six rows (Ceq_w, Ceq_sr, Req_w, Req_sr, Rs0, T_start) of num_walkers values each.
 * out: sum of squared differences between winding and measured, one per walker. */
void sum_of_squares(const double *current_squared, const double *losses, const double *ambient,
                    const double *measured, size_t num_time, double step, const double *theta,
                    size_t num_walkers, double *restrict work, double *restrict out)
{
    double *restrict Tw = work, *restrict Ts = work + num_walkers;
    double *restrict a = work + 2 * num_walkers, *restrict b = work + 3 * num_walkers;
    double *restrict gw = work + 4 * num_walkers, *restrict gs = work + 5 * num_walkers;
    double *restrict c = work + 6 * num_walkers;
    const double B = 234.5;
    for (size_t w = 0; w < num_walkers; w++) {
        a[w] = 1.0 / theta[w];
        b[w] = 1.0 / theta[num_walkers + w];
        gw[w] = 1.0 / theta[2 * num_walkers + w];
        gs[w] = 1.0 / theta[3 * num_walkers + w];
        c[w] = 3.0 * theta[4 * num_walkers + w] / (B + 25.0);
        Tw[w] = Ts[w] = theta[5 * num_walkers + w];
        out[w] = 0.0;
    }
    for (size_t n = 0; n < num_time; n++) {
        const double I2 = current_squared[n], P = losses[n], T0 = ambient[n], y = measured[n];
#pragma GCC ivdep
        for (size_t w = 0; w < num_walkers; w++) {
            const double k = c[w] * I2;
            double copper = k * (B + Tw[w]), flow = gw[w] * (Tw[w] - Ts[w]);
            const double w1 = a[w] * (copper - flow);
            const double s1 = b[w] * (P - copper + flow - gs[w] * (Ts[w] - T0));
            const double mw = Tw[w] + 0.5 * step * w1, ms = Ts[w] + 0.5 * step * s1;
            copper = k * (B + mw);
            flow = gw[w] * (mw - ms);
            const double w2 = a[w] * (copper - flow);
            const double s2 = b[w] * (P - copper + flow - gs[w] * (ms - T0));
            const double ew = Tw[w] + step * (2.0 * w2 - w1), es = Ts[w] + step * (2.0 * s2 - s1);
            copper = k * (B + ew);
            flow = gw[w] * (ew - es);
            const double w3 = a[w] * (copper - flow);
            const double s3 = b[w] * (P - copper + flow - gs[w] * (es - T0));
            Tw[w] += step / 6.0 * (w1 + 4.0 * w2 + w3);
            Ts[w] += step / 6.0 * (s1 + 4.0 * s2 + s3);
            const double r = y - Tw[w];
            out[w] += r * r;
        }
    }
}
