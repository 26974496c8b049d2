"""What DCC 3.3.0 and D-SI 2.2 allow in the elements that heatrun writes, read off the schemas.

Children as a regular expression over their names in a row, texts as one over the text. An element
that does not stand here is not one that a certificate of ours may hold.
"""

import re
from xml.etree.ElementTree import Element

DCC, SI = "{https://ptb.de/dcc}", "{https://ptb.de/si}"

NOT_EMPTY = r"\S+(\s+\S+)*"
DAY = r"\d{4}-\d\d-\d\d"
NUMBER = r"[-+]?((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?"
POSITIVE = NUMBER.replace("[-+]?", r"\+?", 1)

TEXT_TYPE = "(content )+"
CONTACT = "name (eMail )?(phone )?(fax )?(link )?location (descriptionData )?"
RICH = "(name )?((content )*(file )*(formula )*)+"

CHILDREN: dict[str, str] = {
    "digitalCalibrationCertificate": "administrativeData measurementResults "
    "(comment )?(document )?",
    # in any order, each once: ours is that of the list
    "administrativeData": "dccSoftware (refTypeDefinitions )?coreData items calibrationLaboratory "
    "respPersons customer (statements )?",
    "dccSoftware": "(software )+",
    "usedSoftware": "(software )+",
    "software": "name release (type )?(description )?",
    "coreData": "countryCodeISO3166_1 (usedLangCodeISO639_1 )+(mandatoryLangCodeISO639_1 )+"
    "uniqueIdentifier (identifications )?(receiptDate )?beginPerformanceDate endPerformanceDate "
    "performanceLocation (issueDate )?(reportAmendedSubstituted )?(previousReport )?",
    "items": "(name )?(equipmentClass )*(description )?(owner )?(manufacturer )?"
    "(identifications )?(item )+",
    "item": "name (equipmentClass )*(description )?(owner )?(installedSoftwares )?(manufacturer )?"
    "(model )?identifications (itemQuantities )?(subItems )?",
    "identifications": "(identification )+",
    "identification": "issuer value (name )?",
    "calibrationLaboratory": "(calibrationLaboratoryCode )?contact (cryptElectronicSeal )?"
    "(cryptElectronicSignature )?(cryptElectronicTimeStamp )?",
    "contact": CONTACT,
    "customer": CONTACT,
    "manufacturer": CONTACT.replace("location ", "(location )?"),
    "person": CONTACT.replace("location ", "(location )?"),
    "location": "((city|countryCode|postCode|street|further) )+",
    "respPersons": "(respPerson )+",
    "respPerson": "person (description )?(role )?(mainSigner )?(cryptElectronicSeal )?"
    "(cryptElectronicSignature )?(cryptElectronicTimeStamp )?",
    "statements": "(statement )+",
    "statement": "(name )?(description )?(norm )*(reference )*(declaration )?",
    "metaData": "(name )?(description )?(norm )*(reference )*(declaration )?",
    "measurementResults": "(usedMethods )?(usedSoftware )?(measuringEquipments )?"
    "(influenceConditions )?(measurementMetaData )?(measurementResult )+",
    "measurementResult": "name (description )?(usedMethods )?(usedSoftware )?"
    "(measuringEquipments )?(influenceConditions )?results (measurementMetaData )?",
    "usedMethods": "(usedMethod )+",
    "usedMethod": "name (description )?(norm )*(reference )*(link )*(usedMethodQuantities )?",
    "measuringEquipments": "(name )?(equipmentClass )*(description )?(owner )?(identifications )?"
    "(measuringEquipment )+",
    "measuringEquipment": "name (equipmentClass )*(description )?(certificate )?(manufacturer )?"
    "(model )?(identifications )?(measuringEquipmentQuantities )?(installedSoftware )?",
    "influenceConditions": "(influenceCondition )+",
    "influenceCondition": "name (description )?(status )?(certificate )?data ",
    "results": "(result )+",
    "result": "name (description )?data ",
    "data": "((text|formula|byteData|xml|quantity|list) )+",
    "quantity": "(name )?(description )?(noQuantity|charsXMLList|real|list) "
    "(relativeUncertainty )?(usedMethods )?(measurementMetaData )?",
    "measurementMetaData": "(metaData )+",
    "name": TEXT_TYPE,
    "description": RICH,
    "declaration": RICH,
    "further": RICH,
    "real": "(label )?(quantityTypeQUDT )?value unit (significantDigit )?(dateTime )?"
    "(measurementUncertaintyUnivariate )?",
    "measurementUncertaintyUnivariate": "(standardMU|expandedMU|coverageIntervalMU) ",
    "expandedMU": "valueExpandedMU coverageFactor coverageProbability (distribution )?",
    "coverageIntervalMU": "valueStandardMU intervalMin intervalMax coverageProbability "
    "(distribution )?",
}

OF_DSI = {
    "real", "measurementUncertaintyUnivariate", "expandedMU", "coverageIntervalMU", "label", "unit",
    "valueExpandedMU", "valueStandardMU", "coverageFactor", "coverageProbability", "intervalMin",
    "intervalMax",
}  # fmt: skip
"""Elements of the namespace of D-SI; `value` is in both."""

TEXTS: dict[str, str] = {
    "content": ".*",
    "release": NOT_EMPTY,
    "type": "application|library|other",
    "countryCodeISO3166_1": "[A-Z]{2}",
    "countryCode": "[A-Z]{2}",
    "usedLangCodeISO639_1": "[a-z]{2}",
    "mandatoryLangCodeISO639_1": "[a-z]{2}",
    "uniqueIdentifier": NOT_EMPTY,
    "receiptDate": DAY,
    "beginPerformanceDate": DAY,
    "endPerformanceDate": DAY,
    "issueDate": DAY,
    "performanceLocation": "laboratory|customer|laboratoryBranch|customerBranch|other",
    "issuer": "manufacturer|calibrationLaboratory|customer|owner|other",
    "model": NOT_EMPTY,
    "role": NOT_EMPTY,
    "mainSigner": "true|false",
    "reference": NOT_EMPTY,
    "value": NOT_EMPTY,
    "label": ".*",
    "unit": r"(\\[a-z]+(\{-?\d+\})?)+",
    "valueExpandedMU": POSITIVE,
    "valueStandardMU": POSITIVE,
    "intervalMin": NUMBER,
    "intervalMax": NUMBER,
    "coverageFactor": r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))",
    "coverageProbability": r"\+?((0(\.\d*)?)|(1(\.0*)?))",
}


def violations(element: Element, path: str = "") -> list[str]:
    """Return what in an element and below it the schemas do not allow, with its place."""
    space, _, name = element.tag.rpartition("}")
    here = f"{path}/{name}"
    is_value = name == "value" and path.endswith("/real")
    expected = SI if name in OF_DSI or is_value else DCC
    found = [] if space + "}" == expected else [f"{here}: namespace {space}"]
    children = "".join(f"{child.tag.rpartition('}')[2]} " for child in element)
    if name in CHILDREN:
        if not re.fullmatch(CHILDREN[name], children):
            found.append(f"{here}: {children}")
        if (element.text or "").strip():
            found.append(f"{here}: text {element.text!r}")
    elif name in TEXTS:
        pattern = NUMBER if is_value else TEXTS[name]
        if children or not re.fullmatch(pattern, element.text or ""):
            found.append(f"{here}: {element.text!r}")
    else:
        found.append(f"{here}: not known")
    return found + [each for child in element for each in violations(child, here)]


RELEASE = r"[a-zA-Z] ?(\d{1,3}\.){0,3}\d{1,3}"


def against_practice(root: Element) -> list[str]:
    """Return what of PTB's rules of good practice (`dcc.sch` of dcclib 0.4.0), where they are more
    than the schema and call it an error, a certificate does not keep.
    """
    found = [
        f"release {one.text}"
        for one in root.iter(f"{DCC}release")
        if not re.fullmatch(RELEASE, one.text or "")
    ]
    for measured in root.iter(f"{DCC}measurementResult"):
        for name in ("usedMethods", "influenceConditions"):
            found += [] if measured.find(f"{DCC}{name}") is not None else [f"no {name}"]
    languages = [one.text for one in root.iter(f"{DCC}usedLangCodeISO639_1")]
    for parent in root.iter():
        used = [one.get("lang") for one in parent.findall(f"{DCC}content")]
        found += [f"{parent.tag}: {used}"] if used not in ([], languages) else []
    begin, end = (root.findtext(f".//{DCC}{name}PerformanceDate") for name in ("begin", "end"))
    assert None not in (begin, end)
    return found + ([f"{begin} to {end}"] if end < begin else [])
