/* Routines that go wrong, and one that shows the utilities. */
#include "umat.h"
#include <math.h>
#include <string.h>

/* Linear elastic with Young's modulus PROPS(1) and nu = 0, not a number beyond the strain PROPS(2). */
UMAT(lost_)
{
    for (int i = 0; i < 6; i++) {
        stress[i] += props[0] * (i < 3 ? 1.0 : 0.5) * dstran[i];
        if (fabs(stran[i] + dstran[i]) > props[1])
            stress[i] = NAN;
    }
}

/* The same, that asks for a smaller step beyond that strain. */
UMAT(hasty_)
{
    for (int i = 0; i < 6; i++) {
        stress[i] += props[0] * (i < 3 ? 1.0 : 0.5) * dstran[i];
        if (fabs(stran[i] + dstran[i]) > props[1])
            *pnewdt = 0.5;
    }
}

/* Elastic, with the Lame constants PROPS(1..2), and a viscous stress PROPS(3) times the rate of strain while time passes. */
UMAT(viscous_)
{
    double trace = 0.0;
    for (int i = 0; i < 3; i++)
        trace += stran[i] + dstran[i];
    for (int i = 0; i < 6; i++) {
        double strain = stran[i] + dstran[i];
        stress[i] = (i < 3 ? props[0] * trace : 0.0) + props[1] * (i < 3 ? 2.0 : 1.0) * strain;
        if (*dtime > 0.0)
            stress[i] += props[2] * dstran[i] / *dtime;
    }
}

/* Elastic with nu = 0, and writes to STATEV(3), whether there is one or not. */
UMAT(greedy_)
{
    for (int i = 0; i < 6; i++)
        stress[i] += props[0] * (i < 3 ? 1.0 : 0.5) * dstran[i];
    statev[2] = 1.0;
}

/* STATEV: SINV (2) and SPRINC (3) of the stress PROPS(1..6), ROTSIG (6) of it by DROT, SPRINC (3) of it as a strain,
 * then NDI, NSHR, NTENS, KINC, TIME(1), DTIME, TEMP, CELENT, whether COORDS is a number, the first letters of CMNAME. */
UMAT(shown_)
{
    int as_stress = 1, as_strain = 2;
    sinv_(props, statev, statev + 1, ndi, nshr);
    sprinc_(props, statev + 2, &as_stress, ndi, nshr);
    rotsig_(props, drot, statev + 5, &as_stress, ndi, nshr);
    sprinc_(props, statev + 11, &as_strain, ndi, nshr);
    double seen[] = {*ndi, *nshr, *ntens, *kinc, time[0], *dtime, *temp, *celent, coords[0] == coords[0], cmname[0], cmname[79]};
    memcpy(statev + 14, seen, sizeof seen);
}
